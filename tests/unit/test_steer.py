"""`hil set`, `get`, `start` and `stop` over a pair of sides that a test plays."""

import json
import tomllib

import pytest

from bench.live import steer
from bench.live.engines import engine_of
from bench.live.steer import change, order, tell_values, values_of
from hil.config.scenario import Scenario
from hil.errors import BlockedError, ConfigError, LinkError
from hil.names import changes
from hil.names.parameters import apply, live
from hil.toml import assignments_of
from hil.wire.answers import CommandAnswer, read, write
from hil.wire.commands import encode


class Params:
    def __init__(self, config):
        self.config = config


class Side:
    """One process, by what it does with requests; a tick passes with each."""

    def __init__(self, side):
        config = getattr(Scenario(), side)
        self.side, self.tick, self.params = side, 100, Params(config)
        self.changes = changes.Changes(
            side, lambda params, values: Params(apply(params.config, values))
        )

    def answer(self, table):
        self.tick += 10
        self.params, _ = self.changes.take(self.tick, self.params)
        reply = self.changes.ask(encode(table), "test", self.tick, self.params)
        if reply is None:
            return None
        told = CommandAnswer(self.side, reply.is_taken, reply.tick, reply.text, reply.values or {})
        return read(write(told))


class Pair:
    """Both, and what was asked of them."""

    def __init__(self):
        self.sides = {side: Side(side) for side in ("plant", "controller")}
        self.asked, self.closed = [], False

    def alive(self):
        return set(self.sides)

    def ask_all(self, command, to, timeout_s):
        self.asked.append(dict(command))
        if command["kind"] in ("start", "stop"):
            return [CommandAnswer(to[0], command["kind"] == "stop", 5, "mode off")]
        return [self.sides[side].answer(command) for side in to]

    def close(self):
        self.closed = True


@pytest.fixture
def pair(monkeypatch):
    made = Pair()
    monkeypatch.setattr(steer, "joined", lambda _run, _sides: made)
    return made


def kp(pair):
    pair.sides["controller"].answer({"kind": "get"})
    return pair.sides["controller"].params.config.cascade.outer.kp


def test_a_change_of_one_side_is_one_request(pair, capsys):
    assert change(["controller.cascade.outer.kp=41"], None, None, False) == 0
    assert pair.asked == [{"kind": "set", "controller.cascade.outer.kp": 41}]
    line = "controller: controller.cascade.outer.kp = 41.0 (was 39.0); from tick 111\n"
    assert capsys.readouterr().out == line
    assert kp(pair) == 41.0
    assert pair.closed


def test_both_sides_are_asked_first_and_change_at_one_tick(pair, capsys):
    given = ["controller.cascade.outer.kp=41.0", "plant.sensors.noise_x_m=1e-6"]
    assert change(given, None, None, False) == 0
    assert [table["kind"] for table in pair.asked] == ["check", "set"]
    assert pair.asked[1]["at_tick"] == 160
    assert capsys.readouterr().out.count("; from tick 160\n") == 2


def test_where_one_side_refuses_neither_changes(pair, capsys):
    given = ["controller.cascade.outer.kp=41.0", "plant.sensors.noise_x_m=1.0"]
    assert change(given, None, None, False) == 1
    told = capsys.readouterr()
    assert told.out == ""
    line = "plant refused it: plant.sensors.noise_x_m = 1.0; accepted: from 0 to 0.001\n"
    assert told.err == line
    assert kp(pair) == 39.0


def test_the_set_in_force_is_written_and_read_again(pair, tmp_path):
    path = tmp_path / "set.toml"
    given = ["controller.tdc_ref_m=0.0152", "plant.disturbance.load_scale=1.1"]
    assert change(given, None, None, False) == 0
    for side in pair.sides.values():
        side.tick += 100
    assert change([], path, None, False) == 0
    written = dict(assignments_of([f"@{path}"]))
    assert written["controller.tdc_ref_m"] == 0.0152
    assert written["plant.disturbance.load_scale"] == 1.1
    assert "controller.supervisory.target_power_w" not in written
    assert written.keys() <= live("plant").keys() | live("controller").keys()
    assert tomllib.loads(path.read_text())["plant"]["disturbance"]["load_scale"] == 1.1
    assert change([f"@{path}"], None, None, False) == 0


def test_values_come_page_by_page(pair):
    values = values_of(pair)
    assert values.keys() == live("plant").keys() | live("controller").keys()
    assert len(pair.asked) > 2


def test_values_are_printed(pair, capsys):
    assert tell_values(["tdc_ref_m", "*.outer.kp"], None, as_json=False) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == ["controller.tdc_ref_m = none", "controller.cascade.outer.kp = 39.0"]
    tell_values(["plant.sensors"], None, as_json=True)
    assert json.loads(capsys.readouterr().out)["plant.sensors.noise_x_m"] == 0.0
    with pytest.raises(ConfigError, match=r"plant\.model: no parameter of a running engine"):
        tell_values(["plant.model"], None, as_json=False)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ([], "nothing to set; accepted: KEY=VALUE"),
        (["gain=3"], "gain: no parameter of a running engine"),
        (["controller.cascade.outer.kp"], "accepted is key=value"),
        (["@nowhere.toml"], "nowhere.toml"),
    ],
)
def test_what_cannot_be_meant_is_refused_here(pair, given, text):
    with pytest.raises(ConfigError, match=text):
        change(given, None, None, False)
    assert pair.asked == []


def test_orders_are_answered(pair, capsys):
    assert order("stop", None) == 0
    assert capsys.readouterr().out == "controller: mode off; taken at tick 5\n"
    with pytest.raises(BlockedError, match="controller refused start: mode off"):
        order("start", None)


def test_a_key_of_neither_side_and_a_request_without_keys_are_refused_by_the_controller():
    controller, plant = Side("controller"), Side("plant")
    for table in (
        {"kind": "set"},
        {"kind": "set", "nix": 1},
        {"kind": "set", "controller.nix": []},
    ):
        assert not controller.answer(table).taken
        assert plant.answer(table) is None
    assert controller.answer({"kind": "set", "plant.sensors.noise_x_m": 0.0}) is None
    assert not plant.answer({"kind": "get", "keys": 3}).taken


def test_the_engine_of_a_run_is_found_by_its_directory(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_RUNTIME_DIRECTORY", str(tmp_path / "own"))
    monkeypatch.setattr("bench.live.engines.running", list)
    with pytest.raises(LinkError, match="no engine runs"):
        engine_of(None)
    scenario = Scenario(link={"zenoh": {"engine": "two"}}, loop={"clock": "lockstep"})
    (tmp_path / "scenario.json").write_text(scenario.model_dump_json())
    engine = engine_of(tmp_path)
    assert (engine.section.engine, engine.lockstep, engine.link) == ("two", True, "zenoh")
    monkeypatch.setattr("bench.live.engines.running", lambda: [tmp_path, tmp_path])
    with pytest.raises(ConfigError, match="several engines run; accepted is --run"):
        engine_of(None)
