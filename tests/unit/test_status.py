"""`hil status` over a view of a pair that a test plays."""

import json

import pytest

from bench.live import status
from bench.live.status import gather, rows, show, watch
from hil.config.load import build
from hil.errors import ConfigError, LinkError

PLANT = {
    "tick": 3300, "t_s": 3.3, "tdc_mm": 15.501, "late_us": 2, "late_max_us": 81, "missed": 1,
    "answered": 3225, "safe": False, "contacts": 0, "reception": {"ok": 9271, "lost": 2},
}  # fmt: skip
CONTROLLER = {
    "tick": 3300, "mode": "generating", "tdc_mm": 15.5, "tdc_ref_mm": 15.5, "fuel_mg": None,
    "reception": {"ok": 6576, "lost": 0},
}  # fmt: skip


class Pair:
    """A running pair."""

    def __init__(self, rounds=20):
        self.closed = False
        self.controller = dict(CONTROLLER)
        self._told = [("plant", PLANT), ("controller", None)] * rounds
        self._polls = 0

    def alive(self):
        return {"plant", "controller"} if self._told else set()

    def poll_status(self):
        self._polls += 1
        if not self._told or self._polls % 3 == 0:  # nothing more for now
            return None
        process, told = self._told.pop(0)
        return process, told or dict(self.controller)

    def close(self):
        self.closed = True


class Nobody(Pair):
    def __init__(self):
        super().__init__(rounds=0)


@pytest.fixture
def joined(monkeypatch):
    def join(pair):
        monkeypatch.setattr(status, "operator_of", lambda _config: pair)
        monkeypatch.setattr(status, "REACHED_S", 0.1)
        return pair

    return join


def test_the_newest_of_both_is_shown_side_by_side():
    table = {name: cells for name, *cells in rows(gather(Pair()))}
    assert table["TDC"] == ["15.501 mm", "15.500 mm"]
    assert table["mode"] == ["", "generating"]
    assert table["late at most"][0].startswith("81 µs")
    assert table["missed ticks"] == ["1", ""]
    assert table["frames lost"] == ["2", "0"]
    assert "fuel" not in table  # nobody knows it yet


def test_nobody_there_is_an_error_in_one_line(joined):
    pair = joined(Nobody())
    with pytest.raises(LinkError, match="no plant and no controller told their status"):
        show(None, as_json=True)
    assert pair.closed


def test_status_as_json_has_both_processes(joined, capsys):
    pair = joined(Pair())
    assert show(None, as_json=True) == 0
    assert json.loads(capsys.readouterr().out)["plant"]["missed"] == 1
    assert pair.closed


def test_status_names_who_is_not_there(joined, capsys):
    pair = joined(Pair())
    pair._told = [("plant", PLANT)]
    assert gather(pair, 0.05).keys() == {"plant"}
    joined(Pair())._told = [("plant", PLANT)]
    show(None, as_json=False)
    assert "controller: not there" in capsys.readouterr().out


def test_watching_goes_on_until_nobody_is_there(joined, capsys):
    joined(Pair(rounds=5))
    assert watch(None, as_json=True) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {line["process"] for line in lines} <= {"plant", "controller"}
    joined(Pair(rounds=5))
    assert watch(None, as_json=False) == 0


def test_a_run_in_memory_cannot_be_asked(tmp_path):
    scenario = build({"link": {"kind": "memory"}}, "file")
    (tmp_path / "scenario.json").write_text(scenario.model_dump_json())
    with pytest.raises(ConfigError, match="a run in memory has no keys"):
        status.operator_of(tmp_path)
