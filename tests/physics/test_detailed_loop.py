"""The detailed engines under the controller: settled running, changes of load and of fuel."""

import numpy as np
import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from hil.config.load import build


def course_of(model, seconds, **tree):
    """Run the loop; returns its course and the errors of the fired dead centres [m]."""
    tree = {"plant": {"model": model}, "begins": "settled", "run": {"duration_s": seconds}} | tree
    scenario = resolve(build(tree, "test"))
    course = simulate(scenario)
    fires = scenario.controller.timing.fires if scenario.plant.model != "motoring" else (True,)
    fired = np.resize(np.array(fires), len(course.dead_centres))
    tdc = np.array([abs(dc.x_m) for dc in course.dead_centres])
    return course, tdc[fired] - scenario.controller.tdc_ref_m


@pytest.mark.parametrize(
    ("model", "prototype"),
    [
        ("two-stroke", "nu"), ("four-stroke", "nu"), ("two-stroke", "gas-spring"),
        ("two-stroke", "opposed"), ("four-stroke", "mechanical-spring"),
    ],
)  # fmt: skip
def test_fixed_fuel_stays_where_it_settled(model, prototype):
    """Sparks and injections placed by the controller give the motion that the plant settled on."""
    course, errors = course_of(
        model, 1.5, plant={"model": model, "prototype": prototype}, controller={"name": "open-loop"}
    )
    assert course.mode == "generating"
    assert np.max(np.abs(errors)) < 0.1e-3
    fuel = [dc.fuel_kg for dc in course.dead_centres if dc.fuel_kg > 0.0]
    assert len(fuel) > 5
    assert np.ptp(fuel) < 0.005 * max(fuel)


def test_motored_engine_keeps_its_speed_under_the_loop():
    course, errors = course_of("motoring", 1.0)
    assert np.max(np.abs(errors)) < 1e-6
    assert [dc.fuel_kg for dc in course.dead_centres] == [0.0] * len(course.dead_centres)


def settling_s(course, errors, event_s, band_m=0.1e-3):
    """From an instant to the first dead centre after the last one outside the band."""
    t = np.array([dc.t_ns * 1e-9 for dc in course.dead_centres])
    t = t[: len(errors)]
    outside = np.flatnonzero((t >= event_s) & (np.abs(errors) > band_m))
    return t[outside[-1] + 1] - event_s if len(outside) else 0.0


@pytest.mark.parametrize("load", [0.97, 1.03, 0.85, 1.15])
def test_cascade_holds_the_dead_centre_through_a_load_step(load):
    event = {"kind": "load-scale", "value": load, "at_s": 0.3, "at_stroke_fraction": 0.25}
    course, errors = course_of("two-stroke", 0.9, events={"load": event})
    assert course.mode == "generating"
    assert [e for e in course.events if e.code in {"misfire", "contact"}] == []
    assert settling_s(course, errors, 0.3) < 0.18 + 0.02


def test_cascade_holds_the_dead_centre_through_changes_of_fuel():
    """A charge that is worth 5 % less from 0.3 s on, and its full worth again from 0.9 s on."""
    event = {"kind": "efficiency", "low": 0.95, "high": 0.95, "at_s": 0.3, "until_s": 0.9}
    course, errors = course_of("two-stroke", 1.5, events={"fuel": event})
    assert course.mode == "generating"
    assert np.abs(errors).max() < 0.5e-3
    t = np.array([dc.t_ns * 1e-9 for dc in course.dead_centres])
    assert settling_s(course, errors[t < 0.9], 0.3) < 0.18
    assert settling_s(course, errors, 0.9) < 0.18
