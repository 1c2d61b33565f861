"""Reference runs: they cover what there is, and a comparison finds what has changed."""

from typing import get_args

import pytest

from bench.dev import reference
from bench.dev.golden_cases import CASES, Case, scenario_for
from bench.dev.reference import Run
from controller.motion.laws import LAWS
from hil.config.engine.models import OWN_MODELS
from hil.config.process import LinkName
from hil.config.prototypes import PROTOTYPES
from hil.wire.commands import BY_KIND

SHORT = Case("short", "steady", (("run.duration_s", 0.12),))
OTHER = Case("short", "steady", (*SHORT.changes, ("plant.injector.flow_scale_left", 1.01)))


def record(monkeypatch, directory, case, *patterns):
    monkeypatch.setattr(reference, "runs", lambda: iter((Run("golden/short", case),)))
    return reference.main(["record", str(directory), *patterns])


def test_the_same_is_the_same_and_a_changed_parameter_differs(tmp_path, monkeypatch, capsys):
    for name, case in (("a", SHORT), ("b", SHORT), ("other", OTHER)):
        assert record(monkeypatch, tmp_path / name, case) == 0
    a, b, other = (str(tmp_path / name) for name in ("a", "b", "other"))
    capsys.readouterr()
    assert reference.main(["compare", a, b]) == 0
    told = capsys.readouterr().out.splitlines()
    assert [line.partition(", ")[0] for line in told] == [
        "golden/short/controller: same", "golden/short/plant: same", "2 logs",
    ]  # fmt: skip
    assert reference.main(["compare", a, other, "golden/*"]) == 1
    plant = capsys.readouterr().out.splitlines()[1]
    assert plant.startswith("golden/short/plant: differs from tick ")
    assert "/truth" in plant
    (tmp_path / "b/golden/short/plant.mcap").unlink()
    assert reference.main(["compare", a, b]) == 1
    assert "plant.mcap is missing" in capsys.readouterr().out


def test_a_run_that_fails_is_told_and_the_others_go_on(tmp_path, monkeypatch, capsys):
    bad = Case("bad", "steady", (("plant.model", "steam"),))
    wanted = (Run("golden/bad", bad), Run("golden/short", SHORT))
    monkeypatch.setattr(reference, "runs", lambda: iter(wanted))
    assert reference.main(["record", str(tmp_path)]) == 3
    told = capsys.readouterr().out
    assert "golden/bad: ConfigError: golden run bad: plant.model: Input should be" in told
    assert "golden/short: done" in told


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["record", "{}", "nothing"], "no reference run nothing"),
        (["record", "{}"], "holds runs already"),
        (["compare", "{}/no", "{}/one"], "no reference runs of that name"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, capsys, arguments, line):
    there = tmp_path / "golden" / "short"
    there.mkdir(parents=True)
    (there / "plant.mcap").touch()
    assert reference.main([text.format(tmp_path) for text in arguments]) == 2
    assert line in capsys.readouterr().err


def test_golden_runs_hold_every_law_and_every_kind_of_order():
    scenarios = [scenario_for(case) for case in CASES]
    # The law of the four-stroke cycle runs on engines whose bits depend on the machine.
    assert {s.controller.name for s in scenarios} == set(LAWS) - {"cycle"}
    planned = {event.kind for s in scenarios for event in s.events.values()}
    ordered = {order.command["kind"] for case in CASES for order in case.orders}
    assert planned == ordered == set(BY_KIND)


def test_reference_runs_hold_every_model_prototype_and_link():
    changes = [dict(run.case.changes) for run in reference.runs()]
    assert {c.get("plant.model", "harmonic") for c in changes} == set(OWN_MODELS)
    assert {c.get("plant.prototype", "nu") for c in changes} == set(PROTOTYPES)
    assert {run.link for run in reference.runs()} == {"", *get_args(LinkName)}
    names = [run.name for run in reference.runs()]
    assert len(names) == len(set(names))
