"""Laws and engines of one's own in what runs by the dozen: campaign, tuning, comparison."""

import pytest

from bench.own.beginning import write
from bench.run.offline import simulate
from bench.studies import compare as comparison
from bench.studies import compare_page, survey, tune
from bench.studies.campaign.config import Campaign, LoadSpread, Spread, draw, read, scenario_of
from bench.studies.campaign.run import run_one
from bench.studies.trial import Trial, trial_of
from hil.errors import ConfigError

WATCHER = """
class Watcher:
    def step(self, state, view):
        return state, view.point.fuel_kg

    def watch(self, state, view, planned_kg):
        return state, None
"""
FAILS = """
class Fails:
    def step(self, state, view):
        return state, 1.0 / 0.0
"""


@pytest.fixture
def law(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return f"./{write('law', 'my-law', force=False)}"


@pytest.fixture
def engine(law):
    return f"./{write('engine', 'my-engine', force=False)}"


def campaign(law, engine, **given):
    return Campaign(
        name="own", runs=4, seed=3, duration_s=0.5, controllers=("cascade", law), models=(engine,),
        load=LoadSpread(at_s=0.2, ramp_s=0.05), **given,
    )  # fmt: skip


def test_a_campaign_runs_both_and_varies_their_settings(law, engine):
    vary = {"plant.own.settings.friction_n_s_m": Spread(low=0.0, high=50.0)}
    given = campaign(law, engine, vary=vary)
    rows = [run_one(given, index) for index in range(4)]
    assert [row["set_controller"] for row in rows] == ["cascade", law] * 2
    assert {row["mode"] for row in rows} == {"generating"}
    assert not any(row["note"] for row in rows)
    own = scenario_of(given, draw(given, 1))
    assert (own.plant.model, own.controller.name) == ("my-engine", "my-law")
    assert own.plant.own.settings["friction_n_s_m"] > 0.0


def test_a_campaign_file_names_them_and_a_wrong_name_is_refused(law, engine, tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(f'runs = 2\nmodels = ["{engine}"]\ncontrollers = ["{law}"]\n')
    assert read("own.toml").models == (engine,)
    file.write_text('runs = 2\nmodels = ["harmonik"]\n')
    with pytest.raises(ConfigError, match=r"models\.0: Input should be 'closed-form'"):
        read("own.toml")


def test_a_law_that_fails_in_a_run_is_told_in_its_row(law, engine, tmp_path):
    (tmp_path / "fails.py").write_text(FAILS)
    row = run_one(campaign("./fails.py", engine), 1)
    assert row["lost"]
    assert "fails.py line 4: ZeroDivisionError" in row["note"]


def test_gains_are_judged_on_an_engine_of_ones_own(law, engine, monkeypatch):
    trial, gains = trial_of([engine]), tune.gains_in_force(law)
    assert {cell.model for cell in trial.every} == {engine}
    short = Trial(trial.cells[:1], trial.others[:1])
    found = tune.judge_all(law, gains, short.every)
    assert tune.table(law, gains, short, found).count("peak") == 2
    assert tune.cost(short, found) < tune.UNSETTLED


def test_a_search_finds_gains_of_ones_own_law_that_are_no_worse(law):
    cells, others = trial_of()
    trial = Trial(cells[:1], others[:1])
    start = tune.gains_in_force(law)
    found = tune.looked_for(law, start, 1, trial)
    before, after = (
        tune.cost(trial, tune.judge_all(law, gains, trial.every)) for gains in (start, found)
    )
    assert after <= before


def test_a_comparison_shows_both(law, engine, monkeypatch):
    first = dict([next(iter(comparison.MOMENTS.items()))])
    monkeypatch.setattr(comparison, "MOMENTS", first)
    monkeypatch.setattr(compare_page, "MOMENTS", first)
    found = comparison.compare("load-decrease", ("cascade", law), [("plant.model", engine)])
    assert all(cell.response.errors_mm for cell in found.cells.values())  # none was refused
    text = compare_page.table(found)
    assert "my-engine" in text
    assert law in text


def test_what_a_law_of_ones_own_can_know_is_seen_from_its_class(law, tmp_path):
    (tmp_path / "watcher.py").write_text(WATCHER)
    assert (survey.known_to(law), survey.known_to("./watcher.py")) == ("mid-stroke", "full")


def test_a_law_of_ones_own_runs_on_an_engine_of_ones_own(law, engine):
    from bench.run.resolve import resolve
    from bench.run.scenarios import read as scenario

    given = [("controller.name", law), ("plant.model", engine), ("run.duration_s", 0.6)]
    assert simulate(resolve(scenario("steady", given))).mode == "generating"
