"""The golden runs: plant and controller of today repeat them bit by bit.

They change by `hil golden --update` only, which prints the numeric difference of every signal.
"""

from pathlib import Path

import pytest

from bench.dev import golden
from bench.dev.golden_cases import CASES, Case
from bench.logs.replay.replay import replay_file
from hil.errors import LogError
from hil.log.part import ALWAYS

HERE = Path(__file__).parent
LOGS = [f"{case.name}/{process}.mcap" for case in CASES for process in golden.PROCESSES]


@pytest.mark.parametrize("name", LOGS)
def test_a_golden_run_is_repeated_bit_by_bit(name):
    outcome = replay_file(HERE / name, None, ALWAYS)
    assert outcome.found is None, outcome.found.differences
    assert not outcome.gaps
    assert outcome.ticks >= 300


def test_every_recorded_run_is_a_case():
    assert sorted(str(path.relative_to(HERE)) for path in HERE.glob("*/*.mcap")) == sorted(LOGS)


def test_an_update_leaves_what_has_not_changed_and_tells_what_has(tmp_path, monkeypatch, capsys):
    short = ("run.duration_s", 0.12)
    monkeypatch.setattr(golden, "CASES", (Case("one", "steady", (short,)),))
    assert golden.update(tmp_path) == 0
    before = {path: path.read_bytes() for path in tmp_path.glob("*/*.mcap")}
    assert golden.update(tmp_path) == 0
    assert before == {path: path.read_bytes() for path in tmp_path.glob("*/*.mcap")}
    assert golden.check(tmp_path) == 0
    other = ("plant.injector.flow_scale_left", 1.01)
    monkeypatch.setattr(golden, "CASES", (Case("one", "steady", (short, other)),))
    capsys.readouterr()
    assert golden.update(tmp_path) == 0
    told = capsys.readouterr().out
    assert "plant.injector.flow_scale_left: 1.0 -> 1.01" in told
    assert "/truth x_m: " in told
    assert "at the most" in told
    assert golden.check(tmp_path) == 0


def test_a_check_without_runs_is_refused(tmp_path):
    with pytest.raises(LogError, match="no golden runs; `hil golden --update` records them"):
        golden.check(tmp_path)
