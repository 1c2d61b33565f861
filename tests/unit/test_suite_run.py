"""`hil run A B`: a verdict each, one exit code, files for other programs."""

import json
from xml.etree import ElementTree

import pytest

from bench.run.commands import RunOptions
from bench.suite import commands, outputs
from bench.suite.result import Result, exit_code, requirements
from hil.errors import ConfigError

CHANGES = [("link.kind", "memory"), ("loop.clock", "lockstep"), ("run.duration_s", 0.3)]


def test_several_scenarios_are_run_and_told_together(tmp_path, capsys):
    junit = tmp_path / "junit.xml"
    options = commands.of(RunOptions(tmp_path / "out", False, False), junit, as_json=False)
    assert commands.is_suite(["steady", "load-decrease"], junit=None, as_json=False)
    assert commands.run(["steady", "load-decrease"], CHANGES, options) == 1  # ends before its event
    suite = ElementTree.parse(junit).getroot()[0]
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    assert suite[1].find("failure").get("message") == "event 'load' did not happen"
    told = json.loads((tmp_path / "out/suite.json").read_text())
    assert [run["verdict"] for run in told["results"]] == ["met", "not met"]
    assert "1 of 2 met" in (tmp_path / "out/suite.html").read_text()
    assert (tmp_path / "out/steady/summary.json").is_file()
    assert "1/2 steady met" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="--force"):
        commands.run(["steady", "load-decrease"], CHANGES, options)


def test_json_alone_goes_to_standard_output(tmp_path, capsys):
    options = commands.of(RunOptions(tmp_path / "out", False, False), None, as_json=True)
    assert commands.run(["steady"], CHANGES, options) == 0
    assert json.loads(capsys.readouterr().out)["results"][0]["label"] == "steady"


def test_what_is_wrong_with_the_last_is_told_before_the_first_is_run(tmp_path):
    options = commands.of(RunOptions(tmp_path / "out", False, False), None, as_json=False)
    with pytest.raises(ConfigError, match="scenario 'nix'"):
        commands.run(["steady", "nix"], CHANGES, options)
    assert not (tmp_path / "out").exists()
    with pytest.raises(ConfigError, match="--can-log"):
        commands.of(RunOptions(None, False, False, tmp_path / "x.log"), None, as_json=False)


def result(verdict, link="memory", met=True, requirement=""):
    check = {"name": "a", "text": "b", "met": met, "requirement": requirement}
    return Result("it", link, verdict, "why", 0.1, "", False, [check], {})


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [(["met", "none"], 0), (["met", "not met", "blocked"], 1), (["met", "blocked"], 4),
     (["not met", "fault"], 3), ([], 0)],
)  # fmt: skip
def test_the_worst_verdict_is_that_of_all(verdicts, code):
    assert exit_code([result(verdict) for verdict in verdicts]) == code


def test_a_requirement_is_met_when_every_run_that_carries_it_meets_it():
    runs = [result("met", requirement="R"), result("not met", "can", False, "R")]
    assert requirements(runs) == {"R": False}
    assert outputs.side_by_side(runs) == ["    memory   can", "it  met      not met"]
