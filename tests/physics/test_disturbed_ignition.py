"""Sparks that strike late, charges that light themselves, exhaust valves that open late."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest
from valve_rig import ValveRun

from bench.run.offline import simulate
from bench.run.resolve import resolve
from hil.config.load import build
from hil.errors import ConfigError
from plant.build import make_params
from plant.faults import parse
from plant.rig.ignition import strike_ns
from plant.tuning import changed

MAP = {"model": "harmonic", "ignition": {"work": "map"}}
TWO_STROKE = {"model": "two-stroke"}
FOUR_STROKE = {"model": "four-stroke"}


def resolved(plant, seconds=0.45, **events):
    return resolve(
        build({"run": {"duration_s": seconds}, "begins": "settled", "plant": plant,
               "controller": {"running": True}, "events": events}, "test")
    )  # fmt: skip


def ran(plant, seconds=0.45, **events):
    scenario = resolved(plant, seconds, **events)
    return scenario, simulate(scenario)


def pre_ignition(fraction):
    return {"kind": "pre-ignition", "at_s": 0.2, "at_stroke_fraction": fraction}


def test_a_spark_is_late_by_its_jitter_and_never_early():
    jitter_s = 2e-4
    late_s = [(strike_ns(jitter_s, 7, k % 2, 1000 * k) - 1000 * k) * 1e-9 for k in range(20_000)]
    assert min(late_s) >= 0.0
    assert statistics.mean(late_s) == pytest.approx(jitter_s * math.sqrt(2 / math.pi), rel=0.02)
    assert statistics.pstdev(late_s) == pytest.approx(
        jitter_s * math.sqrt(1 - 2 / math.pi), rel=0.02
    )
    assert strike_ns(jitter_s, 7, 0, 12_345) == strike_ns(jitter_s, 7, 0, 12_345)
    assert strike_ns(0.0, 7, 0, 12_345) == 12_345


@pytest.mark.parametrize("plant", [MAP, TWO_STROKE], ids=["map", "two-stroke"])
def test_dead_centres_scatter_with_the_sparks(plant):
    """The more the later they may be; 6e-4 s are not enough to lose one."""
    sigma_mm = []
    for jitter_s in (0.0, 1e-4, 6e-4):
        ignition = {**plant.get("ignition", {}), "jitter_s": jitter_s}
        _, course = ran({**plant, "ignition": ignition}, 1.2)
        assert course.events == []
        sigma_mm.append(
            1e3 * statistics.pstdev(abs(d.x_m) for d in course.dead_centres if d.t_ns > 0.4e9)
        )
    assert sigma_mm[0] < 0.01
    assert sigma_mm[1] > 1.2 * sigma_mm[0]
    assert sigma_mm[2] > 2.5 * sigma_mm[1]


def test_a_spark_behind_the_dead_centre_lights_nothing():
    plant = {"model": "harmonic", "ignition": {"jitter_s": 0.005}}
    _, course = ran(plant, 0.6)
    assert {"late spark"} <= {e.text.split(": ")[1] for e in course.events if e.code == "misfire"}


def test_a_charge_that_lights_itself_does_the_work_of_that_moment():
    """Efficiency by the map of the work over the time from ignition to dead centre."""
    scenario, course = ran(MAP, pre=pre_ignition(0.8))
    (begun,) = [e.t_ns for e in course.events if e.code == "disturbance"]
    at = next(d for d in course.dead_centres if d.t_ns > begun)
    work = make_params(scenario).ignition.work_of(at.t_ns - begun)
    assert at.efficiency == pytest.approx(work, rel=1e-6)
    assert work < 0.98
    others = [d.efficiency for d in course.dead_centres[2:] if d is not at]
    assert min(others) > work
    errors = [1e3 * (abs(d.x_m) - 0.0155) for d in course.dead_centres if d.t_ns > at.t_ns]
    assert abs(errors[0]) > 0.3
    assert abs(errors[-1]) < 0.1


@pytest.mark.parametrize(
    ("plant", "fraction"), [(TWO_STROKE, 0.8), (FOUR_STROKE, 0.9)], ids=["two", "four"]
)
def test_a_detailed_engine_is_pushed_back_by_it(plant, fraction):
    """What burns before the head stops the piston short of it; the spark finds nothing to light."""
    _, plain = ran(plant)
    _, course = ran(plant, pre=pre_ignition(fraction))
    assert [e.code for e in course.events] == ["disturbance"]
    (begun,) = [e.t_ns for e in course.events]
    n = next(k for k, d in enumerate(course.dead_centres) if d.t_ns > begun)
    assert course.dead_centres[n].fuel_kg > 2e-6
    short_mm = 1e3 * (abs(plain.dead_centres[n].x_m) - abs(course.dead_centres[n].x_m))
    assert 0.1 < short_mm < 2.0


def test_a_part_of_a_stroke_is_that_of_the_same_stroke_of_the_cycle_before():
    """Strokes of a four-stroke cycle last from 13 to 77 ms."""
    _, course = ran(FOUR_STROKE, pre=pre_ignition(0.5))
    (begun,) = [e.t_ns for e in course.events]
    n = next(k for k, d in enumerate(course.dead_centres) if d.t_ns > begun)
    start, end = course.dead_centres[n - 1].t_ns, course.dead_centres[n].t_ns
    assert (begun - start) / (end - start) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("plant", [MAP, TWO_STROKE], ids=["map", "two-stroke"])
def test_what_is_not_compressed_lights_nothing(plant):
    _, plain = ran(plant)
    _, course = ran(plant, pre=pre_ignition(0.4))
    assert [d.x_m for d in course.dead_centres] == pytest.approx(
        [d.x_m for d in plain.dead_centres], abs=2e-6
    )


def run_on_lines(model, late_s):
    valves = {"opening_delay_s": 0.8e-3, "closing_delay_s": 0.6e-3}
    late = {"exhaust_late_s": late_s}
    return ValveRun(
        model, 0.5, valves=valves, plant={"model": model, "valves": valves, "disturbance": late}
    )


@pytest.mark.parametrize(("model", "way"), [("two-stroke", 1.0), ("four-stroke", -1.0)])
def test_a_late_exhaust_valve_is_learnt_by_its_position_switch(model, way):
    """It opens while the piston leaves the head of a two-stroke, and comes back to a four's."""
    late_s = 1.5e-3
    run, punctual = run_on_lines(model, late_s), run_on_lines(model, 0.0)
    opening, closing = 0.8e6, 0.6e6
    exhaust = [opening + 1e9 * late_s, closing]
    assert [round(edge.delay_ns) for edge in run.learnt] == [opening, closing, *exhaust] * 2
    first = run.gaps_mm(0.0)["exhaust_left", True][0]
    settled = np.mean(run.gaps_mm(0.3)["exhaust_left", True])
    assert way * (first - settled) > 1.0
    planned = np.mean(punctual.gaps_mm(0.3)["exhaust_left", True])
    assert settled == pytest.approx(planned, abs=0.1)


@pytest.mark.parametrize(
    ("tree", "told"),
    [
        ({"plant": {"model": "harmonic"}, "events": {"a": pre_ignition(0.8)}},
         r"events\.a: pre-ignition: .* accepted with plant\.ignition\.work = map, or on starting"),
        ({"plant": {"model": "two-stroke", "disturbance": {"exhaust_late_s": 0.001}}},
         r"exhaust_late_s: no line moves a valve; accepted with controller\.timing\.valves"),
    ],
)  # fmt: skip
def test_what_would_disturb_nothing_is_refused(tree, told):
    with pytest.raises(ConfigError, match=told):
        resolve(build({"begins": "settled", **tree}, "test"))


def test_a_running_engine_refuses_it_too():
    scenario = resolved({"model": "harmonic"})
    with pytest.raises(ConfigError, match=r"command from here: pre-ignition: .*accepted"):
        parse(b'{"kind": "pre-ignition"}', "here", 0, scenario.plant)
    with pytest.raises(ConfigError, match="exhaust_late_s: no line moves a valve"):
        changed(make_params(scenario), {"plant.disturbance.exhaust_late_s": 0.001})
