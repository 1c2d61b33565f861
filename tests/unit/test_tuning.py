"""What gains are judged by: any model, engine and rate, the same figures in several processes."""

from __future__ import annotations

import pytest

from bench.studies import tune
from bench.studies.trial import Cell, Trial, judge, read_trial, scenario_of
from hil.errors import ConfigError


def test_every_model_at_every_rate_is_judged():
    trial = read_trial("nonlinear, two-stroke", "500,2000", "nu")
    assert {(cell.model, cell.rate_hz) for cell in trial.cells} == {
        (model, rate) for model in ("nonlinear", "two-stroke") for rate in (500, 2000)
    }
    assert len(trial.cells) == 16
    assert {cell.rate_hz for cell in trial.others} == {500}
    assert str(trial.cells[4]).endswith("-15 % at 0.25, 2000 Hz")


@pytest.mark.parametrize("prototype", ["nu", "bit"])
def test_another_engine_is_so_much_another(prototype):
    trial = read_trial("harmonic", "1000", prototype)
    mass, heat = trial.others[0], trial.others[3]
    believed = scenario_of(trial.cells[0], "cascade", {})
    lighter, hotter = (scenario_of(cell, "cascade", {}) for cell in (mass, heat))
    engine = believed.plant.resolved_prototype()
    assert lighter.plant.engine.moving_mass_kg == pytest.approx(0.9 * engine.moving_mass_kg)
    assert hotter.plant.engine.heating_value_j_kg == pytest.approx(1.1 * engine.heating_value_j_kg)
    assert lighter.controller.preset == believed.controller.preset


def test_a_detailed_engine_is_another_by_its_injectors():
    trial = read_trial("two-stroke", "1000", "nu")
    scenario = scenario_of(trial.others[0], "pdf", {})
    assert scenario.plant.injector.flow_scale_left == pytest.approx(0.95)


def test_the_four_stroke_engine_is_judged_by_its_fired_dead_centres():
    cell = read_trial("four-stroke", "1000", "nu").cells[0]
    result = judge(cell, "cycle", {})
    assert 10 <= len(result.times_s) <= 14  # two of four strokes of 0.134 s
    assert result.peak_mm < 1.0
    assert result.peak_after_mm(tune.LATE_S) < 0.25


def test_several_processes_find_the_same():
    cells = (Cell("harmonic", 0.85, 0.25), Cell("rectangular", 1.15, 0.75, rate_hz=500))
    trial, gains = Trial(cells, ()), tune.gains_in_force("cascade")
    with tune.judge_with(2) as judged:
        assert judged("cascade", gains, trial.every) == tune.judge_all(
            "cascade", gains, trial.every
        )


@pytest.mark.parametrize(
    ("models", "rates", "prototype", "told"),
    [
        (None, "1000,x", "nu", r"--rate '1000,x': accepted are whole numbers"),
        (None, "50", "nu", r"loop\.rate_hz: .*accepted: 100 to 20000"),
        ("harmonik", "1000", "nu", r"tune harmonik -15 % at 0\.25: plant\.model: .*harmonic"),
        (None, "1000", "nv", r"plant\.prototype"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(models, rates, prototype, told):
    with pytest.raises(ConfigError, match=told):
        read_trial(models, rates, prototype)


def test_a_law_that_does_not_run_on_a_model_is_refused_before_any_work(monkeypatch):
    monkeypatch.setattr(tune, "judge_with", None)
    trial = read_trial("harmonic,four-stroke", "1000", "nu")
    with pytest.raises(ConfigError, match=r"four-stroke .* is run by open-loop or cycle alone"):
        tune.run(tune.Wanted("cascade", trial))
