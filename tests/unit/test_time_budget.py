"""Rates and delays: what leaves no time for an injection is refused before the run."""

import re
from importlib.util import find_spec

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from controller.timing.budget import budget_of
from hil import compiled
from hil.config.load import build, with_override
from hil.errors import ConfigError
from hil.toml import read_toml

RATES = (500, 1000, 2000, 5000)


def resolved(model="harmonic", prototype="nu", **settings):
    tree = read_toml(find("steady"))
    settings = {"plant.model": model, "plant.prototype": prototype, **settings}
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    return resolve(build(tree, "steady"))


def rows():
    """The table of the documentation."""
    page = (compiled.root() / "docs" / "control.md").read_text(encoding="utf-8")
    section = page.partition("## Rates and delays")[2].partition("\n## ")[0]
    for line in re.findall(r"^\| (\w+, .*) \|$", section, re.MULTILINE)[1:]:
        name, *cells = line.split(" | ")
        yield *name.split(", "), *cells


@pytest.mark.parametrize("row", list(rows()), ids=lambda row: " ".join(row[:2]))
def test_the_table_of_the_documentation_is_what_is_counted(row):
    prototype, model, half_stroke_ms, injection_ms, *delays = row
    if model == "two-stroke" and find_spec("numba") is None:
        pytest.skip("needs the extra `detailed`")
    controller = resolved(model, prototype).controller.model_dump()
    budgets = [budget_of(controller, rate) for rate in RATES]
    assert f"{1e3 * budgets[0].half_stroke_s:.1f}" == half_stroke_ms
    assert f"{1e3 * budgets[0].injection_s:.1f}" == injection_ms
    assert [str(budget.lead_ticks - 1) for budget in budgets] == delays


def slow(**settings):
    return {"loop.rate_hz": 500, **settings}


def test_a_combination_without_time_is_refused_by_name():
    with pytest.raises(ConfigError) as told:
        resolved(**slow(**{"plant.command_delay_ticks": 3}))
    assert "loop.rate_hz 500 with plant.command_delay_ticks 3 on model harmonic" in str(told.value)
    assert "accepted at this rate: a delay up to 1" in str(told.value)


def test_the_controller_is_told_the_delay_and_leaves_time_for_the_charge():
    assert resolved().controller.timing.injection_lead_ticks == 3
    timing = resolved(**slow()).controller.timing
    assert (timing.act_ticks, timing.injection_lead_ticks) == (1, 2)
    timing = resolved(**{"plant.command_delay_ticks": 3}).controller.timing
    assert (timing.act_ticks, timing.injection_lead_ticks) == (4, 4)


def test_what_is_given_is_left_alone():
    given = {"controller.timing.act_ticks": 2, "controller.timing.injection_lead_ticks": 5}
    timing = resolved(**given).controller.timing
    assert (timing.act_ticks, timing.injection_lead_ticks) == (2, 5)


@pytest.mark.parametrize("law", ["cascade", "single-loop", "predictive", "pdf", "observer"])
@pytest.mark.parametrize("delay", [0, 1])
def test_at_500_hertz_no_law_misfires_on_a_load_step(law, delay):
    load = {"kind": "load-scale", "value": 1.15, "at_s": 0.1, "at_stroke_fraction": 0.75}
    settings = {
        "controller.name": law, "plant.command_delay_ticks": delay, "events.load": load,
        "run.duration_s": 0.7, "loop.clock": "lockstep",
    }  # fmt: skip
    course = simulate(resolved(**slow(**settings)))
    assert course.mode == "generating"
    assert [event.code for event in course.events] == ["disturbance"]
    assert abs(abs(course.dead_centres[-1].x_m) - 0.0155) < 1e-4
