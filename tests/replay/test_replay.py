"""Replay: what was recorded is repeated bit by bit, and what is not is found where it happens."""

import json
import math

import pytest
from runs import each_record, make_run, records_of, rewrite

import hil.log
from bench.logs.commands import info as info_command
from bench.logs.commands import replay as replay_command
from bench.logs.replay import differences
from bench.logs.replay.replay import replay_file
from controller.motion import pid
from controller.motion.law import Law
from controller.motion.laws import LAWS
from controller.motion.laws.cascade import Cascade
from drivers import links
from drivers.recorder.client import Recorder
from hil.errors import ConfigError, LogError
from hil.log import Span, topics
from hil.log.coding import of_layout
from hil.log.records import FORMAT, Layout
from hil.ports import CommandSource
from hil.values import replace
from plant.engines.fast import linear

ALWAYS = Span()
PROCESSES = ("plant", "controller")


def replayed(path, span=ALWAYS):
    return replay_file(path, None, span)


@pytest.mark.parametrize("process", PROCESSES)
def test_a_recorded_run_is_repeated_bit_by_bit(run_directory, process):
    outcome = replayed(run_directory / f"{process}.mcap")
    assert (outcome.identical, outcome.ticks, outcome.gaps, outcome.notes) == (True, 700, (), ())


@pytest.mark.parametrize("process", PROCESSES)
@pytest.mark.parametrize(("start_s", "first"), [(0.26, 250), (0.25, 250), (0.2, 0), (0.6, 500)])
def test_a_replay_from_an_instant_begins_at_the_snapshot_before(
    run_directory, process, start_s, first
):
    outcome = replayed(run_directory / f"{process}.mcap", Span(round(start_s * 1e9)))
    assert (outcome.identical, outcome.first_tick, outcome.ticks) == (True, first, 700 - first)


def test_a_replay_to_an_instant_ends_there(run_directory):
    outcome = replayed(run_directory / "plant.mcap", Span(0, 300_000_000))
    assert (outcome.identical, outcome.ticks) == (True, 301)


def nudge(value):
    return math.nextafter(value, math.inf)


class NudgedCascade(Law):
    """A cascade that errs once, in its tenth stroke."""

    name = "cascade"

    def __init__(self, config):
        super().__init__(config)
        self.right, self.calls = Cascade(config), 0

    def initial(self):
        return self.right.initial()

    def step(self, state, view):
        state, demand = self.right.step(state, view)
        self.calls += 1
        if self.calls == 10:
            demand = replace(demand, fuel_kg=nudge(demand.fuel_kg))
        return state, demand


def test_one_ulp_in_a_law_is_found_in_the_tick_in_which_it_is_worked_out(
    run_directory, monkeypatch
):
    monkeypatch.setitem(LAWS, "cascade", NudgedCascade)
    outcome = replayed(run_directory / "controller.mcap")
    with hil.log.open(run_directory / "controller.mcap") as log:
        demand = log.array("/demand")[9]
    assert not outcome.identical
    assert outcome.found.tick == demand["tick"]
    first = outcome.found.differences[0]
    assert (first.topic, first.field, first.recorded, first.replayed) == (
        "/demand", "fuel_kg", demand["fuel_kg"], nudge(float(demand["fuel_kg"])),
    )  # fmt: skip
    assert outcome.found.around


@pytest.mark.interpreted("replaces a function of the plant's step")
def test_one_ulp_in_the_plant_is_found_in_its_tick(run_directory, monkeypatch):
    calls = 0
    original = linear.evaluate

    def nudged(path, tau):
        nonlocal calls
        calls += 1
        x, v = original(path, tau)
        return (nudge(x) if calls == 333 else x), v

    monkeypatch.setattr("plant.engines.fast.model.evaluate", nudged)
    outcome = replayed(run_directory / "plant.mcap")
    assert outcome.different == 1  # the closed form does not build on the position before
    (difference,) = [d for d in outcome.found.differences if d.topic == "/truth"]
    assert (difference.field, difference.tick) == ("x_m", outcome.found.tick)
    assert difference.replayed == nudge(difference.recorded)


@pytest.mark.interpreted("replaces a function of a law")
def test_the_command_tells_both_values_and_the_strokes_around(run_directory, monkeypatch, capsys):
    def other(*arguments):
        state, terms = pid.pid_step(*arguments)
        return state, replace(terms, u=terms.u * 1.001)

    monkeypatch.setattr("controller.motion.laws.cascade.pid_step", other)
    assert replay_command(run_directory / "controller.mcap", None, None, None) == 1
    told = capsys.readouterr().out
    assert "differs first at tick" in told
    assert "/demand fuel_kg" in told
    assert "stroke" in told


def test_the_command_says_identical_and_how_many_ticks(run_directory, capsys):
    assert replay_command(run_directory / "plant.mcap", None, None, None) == 0
    assert "identical, 700 ticks" in capsys.readouterr().out


def without(data, unwanted):
    """The records without some, chosen by (channel, tick)."""
    kept = []
    for channel, record in each_record(data):
        tick = int.from_bytes(record[11:15], "little")
        if not unwanted(channel, tick):
            kept.append(record)
    return b"".join(kept)


@pytest.mark.parametrize("process", PROCESSES)
def test_ticks_that_the_log_has_lost_are_told_and_passed_over(run_directory, tmp_path, process):
    path = run_directory / f"{process}.mcap"
    data = without(records_of(path), lambda _, tick: 301 <= tick <= 340)
    outcome = replayed(rewrite(path, tmp_path / "lost.mcap", data))
    assert outcome.identical
    assert outcome.gaps == ((301, 500),)
    assert outcome.ticks == 700 - 199


def test_events_of_the_recorder_do_not_disturb(run_directory, tmp_path):
    path = run_directory / "controller.mcap"
    records = [record for _, record in each_record(records_of(path))]
    for place in (0, 7, 8, 400, 1201, len(records)):
        records.insert(place, topics.EVENT.pack(1, 1, 1, "log-dropped", "some"))
        records.insert(place, topics.EVENT.pack(0, 0, 0, "real-time", "memory: locked"))
    outcome = replayed(rewrite(path, tmp_path / "noted.mcap", b"".join(records)))
    assert (outcome.identical, outcome.ticks) == (True, 700)


def test_a_log_cut_within_a_tick_is_replayed_up_to_there(run_directory, tmp_path):
    path = run_directory / "plant.mcap"
    records = [record for _, record in each_record(records_of(path))]
    outcome = replayed(rewrite(path, tmp_path / "cut.mcap", b"".join(records[:-3])))
    assert outcome.ticks >= 698
    assert outcome.identical or outcome.found.tick >= 698


def test_operator_commands_are_repeated_as_they_came(tmp_path, monkeypatch):
    """Accepted and refused ones, taken from the command key and not from the scenario."""
    from drivers.channels import MemoryCommands

    given = [
        {"kind": "set-point", "tdc_ref_m": 0.0151},
        {"kind": "set-point", "tdc_ref_m": 7.0},
        {"kind": "stop"},
    ]

    waiting = {}

    def poll(self):
        queue = waiting.setdefault(id(self), list(given))  # each process hears all of them
        return ("tester", json.dumps(queue.pop(0)).encode()) if queue else None

    monkeypatch.setattr(MemoryCommands, "poll", poll)
    directory = make_run(tmp_path / "commanded")
    monkeypatch.undo()
    with hil.log.open(directory / "controller.mcap") as log:
        codes = [event.code for event in log.records("/event")]
        assert log.topics["/command"].messages == 3
    assert {"command", "command-refused", "mode stopping"} <= set(codes)
    assert replayed(directory / "controller.mcap").identical


def test_a_log_without_its_configuration_is_refused(run_directory, tmp_path):
    path = run_directory / "plant.mcap"
    bare = rewrite(path, tmp_path / "bare.mcap", records_of(path), drop_attachments=True)
    with pytest.raises(LogError, match=r"bare\.mcap: cannot be replayed: it carries no scenario"):
        replayed(bare)


def test_a_log_of_an_older_format_is_named_read_and_not_replayed(run_directory, tmp_path, capsys):
    older = tmp_path / "controller.mcap"
    data = (run_directory / "controller.mcap").read_bytes()
    own, old = f"fpeg-hil log {FORMAT}".encode(), f"fpeg-hil log {FORMAT - 1}".encode()
    older.write_bytes(data.replace(own, old, 1))
    with pytest.raises(LogError, match=f"it is of log format {FORMAT - 1}; this version replays"):
        replay_file(older, None, ALWAYS)
    assert info_command(older, verify=False) == 0
    assert f"format    {FORMAT - 1}, older than today's" in capsys.readouterr().out
    with hil.log.open(older) as log:
        assert len(log.array("/timing")) > 0


def test_a_log_that_does_not_say_whose_it_is_is_refused(run_directory, tmp_path):
    path = run_directory / "plant.mcap"
    bare = rewrite(path, tmp_path / "bare.mcap", records_of(path), metadata={})
    with pytest.raises(LogError, match="does not say whether plant or controller wrote it"):
        replayed(bare)


def test_a_configuration_of_another_version_is_refused_by_key(run_directory, tmp_path):
    source = run_directory / "plant.mcap"
    with hil.log.open(source) as log:
        tree = json.loads(log.attachments["scenario.json"].content) | {"warp": 9}
        metadata = {name: v for name, v in log.metadata.items() if name != "recorder"}
    path = tmp_path / "other.mcap"
    attachments = [("scenario.json", "application/json", json.dumps(tree).encode())]
    recorder = Recorder.open(path, metadata, attachments, blocking=True)
    recorder.put(records_of(source)[:100_000])
    recorder.close()
    with pytest.raises(LogError, match=r"other\.mcap: scenario\.json: warp: unknown key"):
        replayed(path)


def test_a_span_that_is_none_is_refused(run_directory):
    with pytest.raises(ConfigError, match="0 <= from <= to"):
        replay_command(run_directory / "plant.mcap", None, 0.5, 0.2)


def rig_log(source, out, names=("/sensor", "/actuator")):
    numbers = {topic.channel_id for topic in topics.ALL if topic.name in names}
    data = b"".join(r for channel, r in each_record(records_of(source)) if channel in numbers)
    return rewrite(source, out, data, only=names)


def test_a_log_of_sensors_and_actuators_alone_is_replayed_and_the_limits_told(
    run_directory, tmp_path
):
    outcome = replayed(rig_log(run_directory / "controller.mcap", tmp_path / "rig.mcap"))
    assert (outcome.identical, outcome.ticks) == (True, 700)
    told = " ".join(outcome.notes)
    assert "no /frames/received" in told
    assert "no /command" in told


def test_a_rig_whose_controller_answers_otherwise_is_told_by_field(run_directory, tmp_path):
    source = run_directory / "controller.mcap"
    path = rig_log(source, tmp_path / "rig.mcap")
    records = [record for _, record in each_record(records_of(path))]
    layout = topics.ACTUATOR.layout
    changed = []
    for record in records:
        if record[9] == topics.ACTUATOR.channel_id and record[11:15] == (90).to_bytes(4, "little"):
            values = list(layout.unpack(record[35:]))
            values[5] += 1.0
            record = topics.ACTUATOR.pack(*values)  # noqa: PLW2901
        changed.append(record)
    data = b"".join(changed)
    names = ("/sensor", "/actuator")
    outcome = replayed(rewrite(source, tmp_path / "other.mcap", data, only=names))
    assert (outcome.different, outcome.found.tick) == (1, 90)
    assert outcome.found.differences[0].field == "load_coefficient_n_s_m"


def test_a_log_without_any_input_is_refused(run_directory, tmp_path):
    path = rig_log(run_directory / "plant.mcap", tmp_path / "t.mcap", ("/truth", "/timing"))
    with pytest.raises(LogError, match="neither /frames/received nor /sensor"):
        replayed(path)


def test_a_field_that_only_one_side_has_is_told_and_not_compared(run_directory, monkeypatch):
    today = differences._TODAY["/truth"]
    fields = (*today.fields, today.fields[-1]._replace(name="extra"))
    newer = today._replace(coding=of_layout(Layout(fields)))
    monkeypatch.setitem(differences._TODAY, "/truth", newer)
    with hil.log.open(run_directory / "plant.mcap") as log:
        records = differences.Records(log)
        told = records.notes()
    assert told == ["/truth.extra is only in today: not compared"]


ORDERED = b'{"kind": "load-scale", "value": 0.95, "until_s": 0.45}'


class OnceOrdered(CommandSource):
    """A command key on which one fault comes, at the third look."""

    def __init__(self):
        self.looks = 0

    def poll(self):
        self.looks += 1
        return ("desk", ORDERED) if self.looks == 3 else None

    def answer(self, *_told):
        pass


@pytest.fixture
def ordered_run(tmp_path, monkeypatch):
    """A run in which an operator orders a load step that ends behind a snapshot."""

    def opened():
        plant, controller = links.open_memory()
        return plant._replace(commands=OnceOrdered()), controller

    monkeypatch.setattr("bench.run.memory.pair.open_memory", opened)
    return make_run(tmp_path / "ordered")


@pytest.mark.parametrize("begins_s", [0.0, 0.3])
def test_an_ordered_fault_is_replayed_from_the_start_and_from_a_snapshot(ordered_run, begins_s):
    with hil.log.open(ordered_run / "plant.mcap") as log:
        texts = [event.text for event in log.records("/event")]
    assert "load-scale from desk" in texts
    assert any("(load-scale) ends" in text for text in texts)
    outcome = replayed(ordered_run / "plant.mcap", Span(round(begins_s * 1e9)))
    assert outcome.found is None, outcome.found.differences
    assert outcome.ticks >= 400
