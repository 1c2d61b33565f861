"""Scenario files that include others and make many scenarios."""

import pytest

from bench.run.checks.times import beyond_the_end
from bench.run.scenarios import read, read_cases
from hil.errors import ConfigError


def write(directory, text, name="mine.toml"):
    path = directory / name
    path.write_text(text)
    return str(path)


def test_a_file_has_what_it_includes_and_its_own_keys_count_last(tmp_path):
    write(tmp_path, "[run]\nseed = 7\nduration_s = 1.0\n", "common.toml")
    mine = write(tmp_path, 'include = ["load-decrease", "common.toml"]\n[run]\nduration_s = 1.5\n')
    scenario = read(mine)
    assert (scenario.run.seed, scenario.run.duration_s) == (7, 1.5)
    assert scenario.events["load"].number("value") == 0.85
    assert scenario.name == "load-decrease"


def test_a_file_that_includes_itself_is_refused(tmp_path):
    mine = write(tmp_path, 'include = "mine.toml"\n')
    with pytest.raises(ConfigError, match=r"mine\.toml: include: nested too deep"):
        read(mine)


CASES = """
include = "load-decrease"
seeds = 2
[cases.light]
events.load.value = 0.9
[cases.heavy]
"events.load.value" = 1.1
[vary]
controller.tdc_ref_m = { from = 0.0150, to = 0.0154, step = 0.0002 }
plant.model = ["harmonic", "rectangular"]
"""


def test_cases_values_and_seeds_are_combined_each_with_each(tmp_path):
    mine = write(tmp_path, CASES)
    found = read_cases(mine)
    assert len(found) == 2 * 3 * 2 * 2
    assert found[0].case.name == "light-tdc_ref_m=0.015-model=harmonic-seed=1"
    last = found[-1].scenario()
    assert last.events["load"].number("value") == 1.1
    assert last.controller.tdc_ref_m == pytest.approx(0.0154)
    assert (last.plant.model, last.run.seed) == ("rectangular", 2)
    assert last.name == "load-decrease-heavy-tdc-ref-m-0-0154-model-rectangular-seed-2"
    one = read(f"{mine}::light-tdc_ref_m=0.0152-model=harmonic-seed=2", [("run.duration_s", 0.1)])
    assert (one.controller.tdc_ref_m, one.run.duration_s) == (pytest.approx(0.0152), 0.1)


def test_one_of_many_must_be_named(tmp_path):
    mine = write(tmp_path, CASES)
    with pytest.raises(ConfigError, match=r"has 24 cases; accepted is .*::CASE, of: light-"):
        read(mine)
    with pytest.raises(ConfigError, match="no case 'lite'; accepted: light-"):
        read(f"{mine}::lite")


def test_a_table_has_a_case_a_row(tmp_path):
    write(tmp_path, "name, run.seed, plant.model\nfirst, 4, nonlinear\nsecond, 5,\n", "cases.csv")
    mine = write(tmp_path, 'include = "steady"\ntable = "cases.csv"\n')
    first, second = (one.scenario() for one in read_cases(mine))
    assert (first.run.seed, first.plant.model) == (4, "nonlinear")
    assert (second.run.seed, second.plant.model) == (5, "harmonic")


def test_a_table_by_itself_names_its_scenarios(tmp_path):
    text = "name,scenario,run.duration_s\na,steady,1.0\nb,load-decrease,1.5\n"
    found = read_cases(write(tmp_path, text, "mine.scenario.csv"))
    assert [one.scenario().name for one in found] == ["steady-a", "load-decrease-b"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("seeds = 0", "seeds: accepted is a whole number above 0"),
        ("seeds = true", "seeds: accepted"),
        ("vary = 3", "vary: accepted is a table"),
        ("[vary]\nrun.seed = []", r"vary\.run\.seed: accepted is one value"),
        ("[vary]\nrun.seed = {from = 1, to = 3}", r"vary\.run\.seed: accepted is a list, or from"),
        ("[vary]\nrun.seed = {from = 1, to = 3, step = -1}", r"vary\.run\.seed: accepted"),
        ("[cases]\na = 1", r"cases: accepted are tables \[cases\.NAME\]"),
        ("include = 3", "include: accepted is a list"),
        ('table = "gone.csv"', r"gone\.csv"),
        ("[vary]\nrun.seed = {from = 1, to = 20000, step = 1}", "accepted"),
        ("[vary]\nrun.sed = [1]", r"run\.sed: unknown key; accepted here: duration_s, seed"),
    ],
)
def test_what_makes_no_scenario_is_refused_by_its_key(tmp_path, text, told):
    mine = write(tmp_path, text)
    with pytest.raises(ConfigError, match=told):
        [one.scenario() for one in read_cases(mine)]


def test_a_run_made_shorter_by_an_override_does_without_what_comes_later():
    scenario = read("load-decrease", [("run.duration_s", 0.5)])
    told = beyond_the_end(scenario)
    assert told == ["events.load.at_s: at 1.1 s of a run that ends at run.duration_s = 0.5"]
