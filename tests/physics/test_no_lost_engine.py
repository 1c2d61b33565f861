"""What has lost an engine once: orders under way, gaps in the samples, late injections."""

import pytest

from bench.run import scenarios
from bench.run.offline import simulate
from bench.run.resolve import resolve
from hil.config.load import build, with_override
from hil.toml import read_toml

BEGUN_NS = 400_000_000


def silent(begin_s, end_s, of):
    return {"link.kind": "memory", "link.silences": [[begin_s, end_s, of]]}


def course_of(settings):
    tree = {**read_toml(scenarios.find("steady")), "expect": {}}
    given = {"loop.clock": "lockstep", "run.duration_s": 0.7, **settings}
    for key, value in given.items():
        tree = with_override(tree, key, value)
    scenario = resolve(build(tree, "lost"))
    return scenario, simulate(scenario)


def worst_mm(scenario, course):
    ref_m = scenario.controller.tdc_ref_m
    return max(abs(abs(dc.x_m) - ref_m) * 1e3 for dc in course.dead_centres if dc.t_ns > BEGUN_NS)


@pytest.mark.parametrize(("model", "delay"), [("harmonic", 1), ("harmonic", 3), ("nonlinear", 2)])
def test_the_machine_knows_which_of_its_orders_brake(model, delay):
    settings = {"plant.model": model, "controller.name": "machine"}
    scenario, course = course_of(settings | {"plant.command_delay_ticks": delay})
    assert course.mode == "generating"
    assert worst_mm(scenario, course) < 0.005


@pytest.mark.parametrize("begin", [512, 515])
def test_an_observer_takes_no_gap_for_a_tick(begin):
    settings = silent(1e-3 * begin, 1e-3 * begin + 7e-3, "samples")
    scenario, course = course_of({"controller.name": "observer", **settings})
    assert course.mode == "generating"
    assert worst_mm(scenario, course) < 1.0


@pytest.mark.parametrize("begin", [259, 261])
def test_a_charge_is_ordered_before_a_gap_however_late_orders_act(begin):
    settings = {"loop.rate_hz": 500, "plant.command_delay_ticks": 2, "controller.tdc_ref_m": 0.0141}
    settings |= silent(2e-3 * begin, 2e-3 * begin + 6e-3, "both")
    scenario, course = course_of(settings)
    assert course.mode == "generating"
    assert worst_mm(scenario, course) < 0.01
