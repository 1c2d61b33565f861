"""The detailed engines under the controller: settled running, changes of load and of fuel."""

import numpy as np
import pytest

from bench.offline import simulate
from bench.resolve import resolve
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
