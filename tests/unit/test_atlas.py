"""The atlas: every fact has a judge or a reason, verdicts follow the criteria, files repeat."""

import json
from fnmatch import fnmatchcase

import pytest
from typer.testing import CliRunner

from bench.cli import app
from bench.studies.atlas import criteria
from bench.studies.atlas.criteria import DEVIATES, NOT_REPRODUCIBLE, PASS, judge, looked_up
from bench.studies.atlas.entries import ENTRIES
from bench.studies.atlas.entry import Finding
from bench.studies.atlas.facts import chapter_of, facts, printed
from bench.studies.atlas.inputs import INPUTS
from bench.studies.atlas.inputs import finding as input_finding
from bench.studies.atlas.run import fingerprint

FACTS = {fact.id: fact for fact in facts()}


def test_every_fact_of_the_thesis_is_there_once():
    assert len(FACTS) == len(facts()) == 474
    kinds = [sum(1 for f in facts() if f.kind == kind) for kind in ("input", "result", "claim")]
    assert kinds == [187, 122, 165]
    assert all((f.value is None) == (f.kind == "claim") for f in facts())


def test_no_fact_is_answered_twice():
    by_entry = [fact.id for entry in ENTRIES.values() for fact in entry.facts]
    assert sorted(by_entry) == sorted(set(by_entry))
    assert INPUTS.keys() <= FACTS.keys()
    assert set(by_entry) & INPUTS.keys() == set()


def test_every_fact_has_a_judge_or_a_reason():
    answered = {fact.id for entry in ENTRIES.values() for fact in entry.facts} | INPUTS.keys()
    assert [f for f in FACTS if f not in answered and looked_up("cannot", f) is None] == []
    assert [f for f in answered if looked_up("cannot", f) is not None] == []


def test_no_criterion_is_left_over():
    for table, rows in criteria.criteria().items():
        stale = [p for p in rows if not any(fnmatchcase(fact, p) for fact in FACTS)]
        assert stale == [], table


def test_each_entry_belongs_to_a_chapter():
    chapters = {fact.chapter for fact in facts()}
    assert [name for name in ENTRIES if chapter_of(name) not in chapters] == []


def verdict(fact_id, ours, told=""):
    return judge(FACTS[fact_id], Finding(ours, told), "hil atlas")


@pytest.mark.parametrize(
    ("fact", "ours", "expected"),
    [
        ("T4.3-two-stroke-speed", 1880.0, PASS),  # 8 %
        ("T4.3-two-stroke-speed", 1800.0, DEVIATES),
        ("A1-F10-peak-130", 18.1, PASS),  # 1 bar
        ("A1-F10-peak-130", 17.9, DEVIATES),
        ("F6.9-settling", 0.2, PASS),  # an upper bound
        ("F6.9-settling", 0.51, DEVIATES),
        ("F6.8-fuel-low", 2.1, PASS),  # a lower bound
        ("F6.8-fuel-low", 1.9, DEVIATES),
        ("F4.10-two-stroke", True, PASS),
        ("F4.10-two-stroke", False, DEVIATES),
        ("T4.3-two-stroke-speed", None, DEVIATES),  # the engine stops
    ],
)
def test_verdicts_follow_the_criteria(fact, ours, expected):
    assert verdict(fact, ours).verdict == expected


def test_a_deviation_says_what_contradicts_it():
    assert "contradicts F6.2-tdc-high" in verdict("F6.2-tdc-low", 2.75).reason
    assert verdict("F4.18-compensation", 43.0, "43 %").reason.startswith("43 %; ")


def test_what_nothing_can_be_held_against_says_why():
    found = judge(FACTS["S4.1.1-battery"], None, "")
    assert (found.verdict, found.ours, found.command) == (NOT_REPRODUCIBLE, None, "")
    assert "rig" in found.reason


def test_settings_come_from_the_configuration():
    """In the printed unit: mm, bar, %, ms."""
    for name in ("T3.2-bore", "T3.2-intake-pressure", "F5.8-step", "E3.19-duration"):
        assert input_finding(FACTS[name]).ours == pytest.approx(printed(name), rel=1e-12)
    assert input_finding(FACTS["S4.1.1-battery"]) is None


def run(*arguments):
    return CliRunner().invoke(app, ["atlas", *map(str, arguments)])


def test_an_atlas_is_written_once_and_the_same_bits_again(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    done = run("F6.2", "T6.1", "--out", first)
    assert done.exit_code == 0, done.output
    assert "T6.1  " in done.output
    rows = {row["id"]: row for row in json.loads((first / "atlas.json").read_text())}
    assert rows["F6.2-tdc-high"]["ours"] == pytest.approx(22.70, abs=0.01)
    assert rows["T6.1-speed"]["ours"] is True
    assert {"id", "thesis", "ours", "unit", "deviation", "tolerance", "verdict", "command",
            "reason"} <= rows["T6.1-speed"].keys()  # fmt: skip
    assert "T6.1  " not in run("F6.2", "T6.1", "--out", first).output  # nothing is made again
    (first / "parts" / "T6.1.json").write_text("{")
    assert "T6.1  " in run("F6.2", "T6.1", "--out", first).output
    run("F6.2", "T6.1", "--out", second)
    for name in ("atlas.json", "index.html", "chapter-6.html", "parts/T6.1.json"):
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_quick_form_is_another_result():
    """A part made in the short form is not taken for the whole one."""
    assert fingerprint(True) != fingerprint(False)
    assert fingerprint(True) == fingerprint(True)


def test_a_name_that_there_is_not_is_told(tmp_path):
    done = run("F9.9", "--out", tmp_path / "atlas")
    assert done.exit_code != 0
    assert "accepted are chapters" in str(done.exception)
    assert not (tmp_path / "atlas").exists()
