"""Every law in the loop, against the physical bound; ticks, injector edges and all."""

import statistics

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from bench.studies.bound import step_bound
from bench.studies.trial import Cell, judge, read_off, scenario_of, trial_of
from controller.motion.choice import make_laws, refusal
from controller.motion.laws import LAWS
from hil.config.controller import ControllerConfig
from hil.config.load import build, with_override
from hil.config.prototypes import NU
from hil.errors import ConfigError
from hil.toml import read_toml
from plant.engines.fast.constants import constants_of

REF, LOAD = 0.0155, 810.0
SLACK_MM = 0.012
"""What a tick's edges and the sensors' grid cost, beside the five per cent."""


def run(law, settings=(), scenario="load-decrease"):
    tree = with_override(read_toml(find(scenario)), "controller.name", law)
    for key, value in settings:
        tree = with_override(tree, key, value)
    resolved = resolve(build(tree, law))
    return resolved, simulate(resolved)


def errors_mm(course, ref_m=REF):
    return [1e3 * (abs(dc.x_m) - ref_m) for dc in course.dead_centres]


def bound_of(cell, knowledge):
    return step_bound(constants_of(NU, cell.model), REF, LOAD, cell.load, cell.fraction, knowledge)


@pytest.mark.parametrize("cell", trial_of().cells, ids=str)
def test_pdf_reaches_the_full_bound(cell):
    result, bound = judge(cell, "pdf", {}), bound_of(cell, "full")
    assert result.peak_mm <= 1.05 * bound.peak_mm + SLACK_MM
    assert result.settling_ms <= 60.0


@pytest.mark.parametrize("cell", trial_of().cells, ids=str)
def test_predictive_reaches_the_bound_of_mid_stroke_knowledge(cell):
    result, bound = judge(cell, "predictive", {}), bound_of(cell, "mid-stroke")
    assert result.peak_mm <= 1.05 * bound.peak_mm + SLACK_MM
    assert result.settling_ms <= 90.0


@pytest.mark.parametrize("cell", trial_of().cells, ids=str)
def test_observer_sees_the_step_without_a_power_sensor(cell):
    result, bound = judge(cell, "observer", {}), bound_of(cell, "mid-stroke")
    assert result.peak_mm <= 1.05 * bound.peak_mm + SLACK_MM
    assert result.settling_ms <= 90.0


@pytest.mark.parametrize("cell", trial_of().cells, ids=str)
def test_machine_beats_what_fuel_alone_can_do(cell):
    result, bound = judge(cell, "machine", {}), bound_of(cell, "full")
    if cell.fraction > 0.5:
        assert result.peak_mm < bound.peak_mm
    else:
        assert result.peak_mm <= 0.5 * abs(bound.errors_mm[0])
    assert result.settling_ms <= 60.0


@pytest.mark.parametrize(
    ("law", "load", "fraction"),
    [("pdf", 0.85, 0.25), ("pdf", 1.15, 0.75), ("observer", 0.85, 0.75), ("observer", 1.15, 0.25)],
)
def test_the_gas_law_takes_them_to_the_full_bound(law, load, fraction):
    cell = Cell("nonlinear", load, fraction)
    result, bound = judge(cell, law, {}), bound_of(cell, "full")
    phase_mm = 0.03 if law == "observer" and cell.fraction > 0.5 else 0.0
    assert result.peak_mm <= 1.05 * bound.peak_mm + SLACK_MM + phase_mm
    assert result.settling_ms <= 60.0


@pytest.mark.parametrize(("load", "fraction"), [(0.85, 0.25), (1.15, 0.25)])
def test_what_shows_in_part_at_first_is_taken_for_the_load_alone(load, fraction):
    cell = Cell("nonlinear", load, fraction)
    result, bound = judge(cell, "predictive", {}), bound_of(cell, "mid-stroke")
    assert result.peak_mm <= 1.05 * bound.peak_mm
    assert result.settling_ms <= 80.0


@pytest.mark.parametrize("ref", [0.0135, 0.0138])
@pytest.mark.parametrize("law", ["cascade", "observer"])
def test_no_spark_misses_its_window_where_the_gas_hardens(law, ref):
    settings = [("plant.model", "nonlinear"), ("controller.tdc_ref_m", ref),
                ("run.duration_s", 0.6)]  # fmt: skip
    _, course = run(law, settings, "steady")
    assert course.events == []
    assert max(map(abs, errors_mm(course, ref))) < 0.04


def test_combustion_noise_takes_no_engine_that_follows_the_gas_law():
    settings = [("plant.model", "nonlinear"), ("run.duration_s", 2.0)]
    _, course = run("pdf", settings, "variations")
    assert course.mode == "generating"
    assert {event.code for event in course.events} == {"disturbance"}


@pytest.mark.parametrize("law", ["predictive", "observer"])
@pytest.mark.parametrize("ref", [0.013, 0.016])
@pytest.mark.parametrize("load", [0.8, 1.2])
@pytest.mark.parametrize("model", ["harmonic", "rectangular"])
def test_set_points_and_large_steps_need_no_other_tuning(law, ref, load, model):
    settings = [
        ("plant.model", model), ("controller.tdc_ref_m", ref), ("events.load.value", load),
        ("events.load.at_s", 0.1), ("events.load.at_stroke_fraction", 0.6),
        ("run.duration_s", 0.7),
    ]  # fmt: skip
    _, course = run(law, settings)
    assert course.mode == "generating"
    assert not [event for event in course.events if event.code in ("contact", "misfire")]
    assert read_off(course, ref).settling_ms <= 200.0


@pytest.mark.parametrize("law", ["predictive", "pdf", "observer", "machine"])
def test_an_injector_that_lets_through_more_is_learnt(law):
    settings = [("plant.injector.flow_scale_left", 1.03), ("run.duration_s", 1.5)]
    _, course = run(law, settings, "steady")
    late = errors_mm(course)[-12:]
    assert max(map(abs, late)) < 0.05
    assert abs(statistics.mean(late[::2]) - statistics.mean(late[1::2])) < 0.03


@pytest.mark.parametrize("law", ["predictive", "pdf", "observer", "machine"])
@pytest.mark.parametrize("mass", [0.9, 1.1])
def test_another_mass_than_believed_is_learnt(law, mass):
    cell = Cell("harmonic", 0.85, 0.25, (("engine.moving_mass_kg", mass),))
    scenario = scenario_of(cell, law, {})
    course = simulate(scenario)
    assert abs(statistics.mean(errors_mm(course)[-10:])) < 0.05


@pytest.mark.parametrize("model", ["harmonic", "rectangular"])
def test_laws_take_over_from_each_other_without_a_bump(model):
    tree = with_override(read_toml(find("steady")), "plant.model", model)
    order = ("pdf", "observer", "machine", "predictive", "single-loop", "cascade")
    tree["events"] = {"load": {"kind": "load-scale", "value": 0.9, "at_s": 0.0}}
    for k, law in enumerate(order):
        tree["events"][f"to_{k}"] = {"kind": "law", "law": law, "at_s": 0.8 + 0.3037 * k}
    tree = with_override(tree, "run.duration_s", 2.8)
    course = simulate(resolve(build(tree, "switching")))
    after = [e for dc, e in zip(course.dead_centres, errors_mm(course), strict=True)
             if dc.t_ns > 0.8e9]  # fmt: skip
    assert course.mode == "generating"
    assert max(map(abs, after)) < 0.08


@pytest.mark.parametrize("name", ["cascade", "single-loop", "open-loop", "predictive"])
def test_laws_that_need_no_ticks_have_no_part_in_them(name):
    assert not LAWS[name](ControllerConfig()).watches


def test_a_law_that_cannot_work_is_refused_by_name():
    laws = make_laws(ControllerConfig())
    assert "preset" in refusal("pdf", laws, None)
    assert refusal("cascade", laws, None) == ""
    with pytest.raises(ConfigError, match="closed-form"):
        run("machine", [("plant.model", "closed-form")])


def test_saturated_fuel_does_not_wind_up():
    settings = [("controller.limits.fuel_max_kg", 2.9e-6), ("events.load.value", 1.3),
                ("events.load.at_s", 0.1), ("events.load.until_s", 0.8),
                ("run.duration_s", 1.3)]  # fmt: skip
    for law in ("pdf", "predictive", "observer"):
        _, course = run(law, settings)
        assert min(errors_mm(course)) < -0.5
        assert max(map(abs, errors_mm(course)[-5:])) < 0.1
