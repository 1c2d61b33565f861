"""`hil status`, `set`, `start` and `stop` over a view of a pair that a test plays."""

import json

import pytest

from bench.live import status
from bench.live.status import commands_of, gather, order, rows, set_points, show, watch
from hil.config.load import build
from hil.errors import BlockedError, ConfigError, LinkError
from hil.wire.answers import CommandAnswer

PLANT = {
    "tick": 3300, "t_s": 3.3, "tdc_mm": 15.501, "late_us": 2, "late_max_us": 81, "missed": 1,
    "answered": 3225, "safe": False, "contacts": 0, "reception": {"ok": 9271, "lost": 2},
}  # fmt: skip
CONTROLLER = {
    "tick": 3300, "mode": "generating", "tdc_mm": 15.5, "tdc_ref_mm": 15.5, "fuel_mg": None,
    "reception": {"ok": 6576, "lost": 0},
}  # fmt: skip


class Pair:
    """A running pair that takes its commands, unless it has a reason to refuse them."""

    def __init__(self, ignores="", rounds=20):
        self.taken, self.closed, self.ignores = [], False, ignores
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

    def ask(self, command, to, timeout_s):
        if self.ignores:
            return CommandAnswer(to, False, 3310, self.ignores)
        self.taken.append(dict(command))
        return CommandAnswer(to, True, 3310, "mode generating, set point 15.200 mm")

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
        gather(pair, 0.05)
    with pytest.raises(LinkError, match="no controller takes commands"):
        order("stop", None)
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


def test_a_set_point_is_sent_and_seen_to_be_taken(joined, capsys):
    pair = joined(Pair())
    assert set_points(["tdc_ref_m=0.0152"], None) == 0
    assert pair.taken == [{"kind": "set-point", "tdc_ref_m": 0.0152}]
    line = "controller: mode generating, set point 15.200 mm; taken at tick 3310\n"
    assert capsys.readouterr().out == line


def test_a_command_that_is_not_taken_is_told_with_the_bound(joined):
    pair = joined(Pair(ignores="tdc_ref_m=0.0152 from hil: accepted up to 0.015"))
    line = r"^controller refused set-point: tdc_ref_m=0\.0152 from hil: accepted up to 0\.015$"
    with pytest.raises(BlockedError, match=line):
        set_points(["tdc_ref_m=0.0152"], None)
    assert pair.closed


def test_start_and_stop_are_sent(joined):
    pair = joined(Pair())
    order("stop", None)
    assert pair.taken == [{"kind": "stop"}]


def test_set_points_and_the_law_are_commands_of_their_own():
    given = ["tdc_ref_m=0.015", "target_power_w=900", "law=single-loop"]
    assert [command.table() for command in commands_of(given)] == [
        {"kind": "set-point", "tdc_ref_m": 0.015, "target_power_w": 900},
        {"kind": "law", "law": "single-loop"},
    ]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ([], "nothing to set; accepted: tdc_ref_m"),
        (["gain=3"], "gain: unknown; accepted: tdc_ref_m"),
        (["tdc_ref_m=0.2"], r"tdc_ref_m = 0.2; accepted: 0.001 to 0.05"),
        (["tdc_ref_m=high"], "tdc_ref_m = 'high'"),
        (["law=best"], "law = 'best': accepted: cascade"),
    ],
)
def test_what_the_controller_would_refuse_is_refused_here(given, text):
    with pytest.raises(ConfigError, match=text):
        commands_of(given)


def test_a_run_in_memory_cannot_be_asked(tmp_path):
    scenario = build({"link": {"kind": "memory"}}, "file")
    (tmp_path / "scenario.json").write_text(scenario.model_dump_json())
    with pytest.raises(ConfigError, match="a run in memory has no keys"):
        status.operator_of(tmp_path)
