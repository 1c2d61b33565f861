"""The controller's turn with every port in the test's hand: gaps, late frames, commands."""

import math
from collections import UserList

import pytest

from controller.build import initial_state, make_params
from controller.loop import ControllerLoop
from controller.mode.start_restart import Mode
from hil import pacing, ports
from hil.config.controller import ControllerConfig
from hil.config.prototypes import NU
from hil.log import topics
from hil.log.records import MESSAGE_HEAD, PAYLOAD_OFFSET
from hil.wire.codec import Decoder, Encoder
from hil.wire.commands import OperatorCommand
from hil.wire.messages import PistonSample, PlantTick

MS = 1_000_000
NAN = math.nan
TOPICS = {topic.channel_id: topic for topic in topics.ALL}


class Link(ports.Link):
    def __init__(self):
        self.sent = []

    def send(self, batch):
        self.sent.append(batch)


class Pacer(pacing.Pacer):
    def __init__(self):
        super().__init__(MS, MS)
        self.t_ns = 0
        self.started = []

    def start(self, tick=0):
        self.started.append(tick)

    def now_ns(self):
        self.t_ns += 1000
        return self.t_ns


class Log(ports.Recorder, UserList):
    """Takes packed records apart again: (topic name, fields by name)."""

    def put(self, data):
        while data:
            _, length, channel, *_ = MESSAGE_HEAD.unpack_from(data)
            topic = TOPICS[channel]
            values = topic.layout.unpack(data[PAYLOAD_OFFSET : 9 + length])
            names = [field.name for field in topic.layout.fields]
            self.append((topic.name, dict(zip(names, values, strict=True))))
            data = data[9 + length :]

    def of(self, topic):
        return [fields for name, fields in self if name == topic]

    def codes(self):
        return [event["code"] for event in self.of("/event")]


class Status(ports.StatusSink, UserList):
    def publish(self, status):
        self.append(status)


class Commands(ports.CommandSource, UserList):
    answers = ()

    def poll(self):
        return self.pop(0) if self else None

    def answer(self, *told):
        self.answers = (*self.answers, told)


class Bench:
    """A controller loop, and a plant's encoder to talk to it."""

    def __init__(self, schedule=None, **config):
        params = make_params(ControllerConfig(**config), NU, MS)
        self.link, self.pacer, self.log = Link(), Pacer(), Log()
        self.status, self.commands = Status(), Commands()
        self.encoder, self.decoder = Encoder(), Decoder("controller")
        self.loop = ControllerLoop(
            params, initial_state(params), ports=self, pacer=self.pacer, recorder=self.log,
            schedule=schedule or {}, status_every=100,
            peer_timeout_s=1.0,
        )  # fmt: skip

    def batch(self, tick, x_m=-0.0155, v_m_s=0.0):
        head = PlantTick(tick % 2**32, 2, 0, 810.0 * v_m_s**2 + 20.0, NAN, NAN)
        return self.encoder.encode((head, PistonSample(x_m, v_m_s)))

    def turn(self, *ticks):
        for tick in ticks:
            self.loop.turn(self.batch(tick))

    def answers(self):
        """(tick answered, messages) of what was sent since the last call."""
        sent, self.link.sent = self.link.sent, []
        decoded = [self.decoder.decode(batch) for batch in sent]
        return [(messages[0].tick, messages) for messages in decoded]


def test_every_sample_is_answered_once_with_its_tick():
    bench = Bench()
    bench.turn(0, 1, 2, 3)
    assert [tick for tick, _ in bench.answers()] == [0, 1, 2, 3]
    assert [s["status"] for s in bench.log.of("/sensor")] == [topics.SAMPLE_FRESH] * 4
    assert [t["used_tick"] for t in bench.log.of("/timing")] == [0, 1, 2, 3]
    assert [t["missed"] for t in bench.log.of("/timing")] == [0] * 4


def test_the_log_has_the_bytes_of_both_directions():
    bench = Bench()
    batch = bench.batch(0)
    bench.loop.turn(batch)
    assert [f["data"] for f in bench.log.of("/frames/received")] == [batch]
    assert [f["data"] for f in bench.log.of("/frames/sent")] == bench.link.sent


def test_tick_without_a_sample_is_stepped_answered_and_marked():
    bench = Bench()
    bench.turn(0)
    bench.loop.turn(None)
    bench.turn(2)
    assert [tick for tick, _ in bench.answers()] == [0, 1, 2]
    assert [s["status"] for s in bench.log.of("/sensor")] == [
        topics.SAMPLE_FRESH, topics.SAMPLE_NONE, topics.SAMPLE_FRESH,
    ]  # fmt: skip
    assert [t["used_tick"] for t in bench.log.of("/timing")] == [0, -1, 2]
    assert bench.loop.state.stale == 0


def test_last_known_values_stand_in_the_log_of_a_tick_without_a_sample():
    bench = Bench()
    bench.loop.turn(bench.batch(0, 0.003, 1.5))
    bench.loop.turn(None)
    first, second = bench.log.of("/sensor")
    assert (second["x_m"], second["v_m_s"]) == (first["x_m"], first["v_m_s"])
    assert second["electric_power_w"] == first["electric_power_w"] > 0.0


def test_late_sample_is_logged_and_never_acted_on():
    bench = Bench()
    bench.turn(0)
    late = bench.batch(1)
    bench.loop.turn(None)
    before = bench.loop.state
    bench.answers()
    bench.loop.turn(late)
    assert bench.loop.state == before
    assert bench.loop.tick == 1
    assert bench.answers() == []
    assert bench.log.codes() == ["sample-late"]
    assert bench.log.of("/event")[0]["text"] == (
        "sample of tick 1 came after tick 1 was answered without it"
    )
    assert bench.log.of("/frames/received")[-1]["data"] == late
    bench.turn(2)
    assert [tick for tick, _ in bench.answers()] == [2]


def test_samples_of_a_gap_are_stepped_without_an_answer_and_marked_missed():
    bench = Bench()
    bench.turn(0, 4)
    assert [tick for tick, _ in bench.answers()] == [0, 4]
    timing = bench.log.of("/timing")
    assert [t["tick"] for t in timing] == [0, 1, 2, 3, 4]
    assert [t["missed"] for t in timing] == [0, 1, 1, 1, 0]
    assert bench.loop.state.stale == 0


def test_a_gap_as_long_as_the_limit_leads_to_the_safe_state():
    bench = Bench()
    bench.turn(0, 1, 13)
    assert bench.loop.state.mode is Mode.SAFE
    assert "mode safe" in bench.log.codes()


def test_batch_with_a_broken_head_counts_as_an_invalid_sample():
    bench = Bench()
    bench.turn(0)
    batch = bytearray(bench.batch(1))
    batch[5] ^= 1
    bench.loop.turn(bytes(batch))
    bench.turn(2)
    assert [tick for tick, _ in bench.answers()] == [0, 1, 2]
    assert bench.log.of("/sensor")[1]["status"] == topics.SAMPLE_INVALID
    assert bench.loop.reception.decoder.counts().corrupted == 1


def test_batch_with_a_broken_sample_keeps_its_tick():
    bench = Bench()
    bench.turn(0)
    batch = bytearray(bench.batch(1))
    batch[15] ^= 1
    bench.loop.turn(bytes(batch))
    assert bench.loop.tick == 1
    assert bench.loop.state.stale == 1
    assert bench.log.of("/timing")[1]["used_tick"] == -1


@pytest.mark.parametrize("junk", [b"", b"x", b"not a batch at all", bytes(20), b"\xff" * 35])
def test_whatever_comes_over_the_link_the_loop_goes_on(junk):
    bench = Bench()
    bench.turn(0)
    bench.loop.turn(junk)
    bench.turn(2)
    assert bench.loop.tick == 2
    assert bench.loop.state.stale == 0


def test_first_frames_decide_the_tick_to_begin_with():
    bench = Bench()
    bench.turn(5000)
    assert bench.pacer.started == [5000]
    assert [t["tick"] for t in bench.log.of("/timing")] == [5000]


def test_before_a_first_valid_head_nothing_is_answered():
    bench = Bench()
    bench.loop.turn(b"\xff" * 20)
    assert bench.answers() == []
    assert bench.log.codes() == ["sample-refused"]
    bench.turn(70)
    assert bench.pacer.started == [70]
    assert [tick for tick, _ in bench.answers()] == [70]


def test_tick_far_ahead_is_refused_rather_than_caught_up_with():
    bench = Bench()
    bench.turn(0, 1)
    bench.turn(100_000)
    assert bench.loop.tick == 2
    assert bench.log.of("/sensor")[-1]["status"] == topics.SAMPLE_INVALID


def test_older_batch_is_not_acted_on_even_when_its_counter_would_pass():
    bench = Bench()
    old = bench.batch(0)
    for tick in range(1, 16):
        bench.turn(tick)
    state = bench.loop.state
    bench.loop.turn(old)
    assert bench.loop.state == state
    assert bench.log.codes() == ["sample-late"]


@pytest.mark.parametrize("lost", [7, 8, 9, 12, 15, 16, 40])
def test_sample_after_a_long_silence_is_accepted_at_once(lost):
    """The counter has four bits: after so many lost frames it says nothing any more."""
    bench = Bench(limits={"stale_s": 1.0})
    bench.turn(0, 1)
    for tick in range(2, 2 + lost):
        bench.batch(tick)
        bench.loop.turn(None)
    bench.turn(2 + lost)
    assert bench.loop.state.stale == 0


def test_sender_that_repeats_itself_is_a_lost_one():
    bench = Bench()
    bench.turn(0)
    batch = bench.batch(1)
    for _ in range(14):
        bench.loop.turn(batch)
    assert bench.loop.state.mode is Mode.SAFE
    assert bench.loop.reception.decoder.counts().repeated >= 20


def test_refused_command_is_logged_with_its_origin_and_changes_nothing():
    bench = Bench()
    bench.commands.append(("desk 2", b'{"kind": "explode"}'))
    bench.turn(0, 1)
    (event,) = bench.log.of("/event")
    assert event["code"] == "command-refused"
    assert event["severity"] == topics.WARNING
    assert event["text"].startswith("command from desk 2: kind must be one of start, stop")
    assert bench.loop.state.mode is Mode.GENERATING


def test_command_key_is_looked_at_every_tenth_tick():
    bench = Bench()
    bench.turn(0, 1)
    bench.commands.append(("desk 2", b'{"kind": "set-point", "tdc_ref_m": 0.0145}'))
    bench.turn(*range(2, 10))
    assert bench.loop.state.set_points.tdc_ref_m == 0.0155
    bench.turn(10)
    assert bench.loop.state.set_points.tdc_ref_m == 0.0145
    assert bench.log.of("/event")[0]["text"] == "set-point tdc_ref_m=0.0145 from desk 2"


def test_planned_command_is_obeyed_in_its_tick_even_when_that_was_missed():
    bench = Bench(schedule={2: OperatorCommand("stop")})
    bench.turn(0, 4)
    assert bench.loop.state.mode is Mode.STOPPING
    assert bench.log.codes()[0] == "command"
    assert bench.log.of("/event")[0]["tick"] == 2


def test_safe_state_is_a_fault_in_the_log_with_its_reason():
    bench = Bench()
    bench.turn(0)
    for _ in range(11):
        bench.loop.turn(None)
    (event,) = bench.log.of("/event")
    assert (event["severity"], event["text"]) == (topics.FAULT, "GENERATING -> SAFE: sample lost")
    assert event["tick"] == 11
    assert bench.answers()[-1][1][0].mode == int(Mode.SAFE)


def test_status_is_told_now_and_then():
    bench = Bench()
    bench.turn(*range(201))
    assert [status["tick"] for status in bench.status] == [0, 100, 200]
    assert bench.status[0]["mode"] == "generating"


def stroked(bench, ticks, period=50):
    """Let the piston oscillate with 15.5 mm, two strokes in `period` ticks."""
    for tick in range(ticks):
        phase = 2.0 * math.pi * tick / period
        x_m, v_m_s = -0.0155 * math.cos(phase), 0.0155 * 2e3 * math.pi / period * math.sin(phase)
        bench.loop.turn(bench.batch(tick, x_m, v_m_s))


def test_status_has_the_fuel_of_the_last_finished_stroke_at_every_instant():
    bench = Bench()
    bench.loop._status_every = 1
    stroked(bench, 400)
    fuels = [status["fuel_mg"] for status in bench.status]
    assert fuels[0] is None
    burnt = [s["fuel_kg"] * 1e6 for s in bench.log.of("/stroke")][1:]
    assert min(burnt) > 1.0
    assert set(fuels[100:]) <= set(burnt)


def test_status_of_an_engine_at_rest_has_no_dead_centre_and_no_load():
    bench = Bench(running=False)
    bench.turn(0)
    (status,) = bench.status
    assert (status["mode"], status["tdc_mm"], status["load_n_s_m"]) == ("off", None, 0.0)


def test_an_order_that_was_due_before_the_first_sample_is_followed_with_it():
    bench = Bench(running=False, schedule={2: OperatorCommand("start")})
    bench.turn(7, 8)
    assert bench.loop.state.mode is Mode.MOTORING
    assert "mode motoring" in bench.log.codes()


def test_a_planned_start_waits_for_samples():
    bench = Bench(running=False, schedule={12: OperatorCommand("start")})
    bench.turn(0)
    for _ in range(bench.loop.params.bounds.stale_ticks + 4):
        bench.loop.turn(None)
    assert bench.loop.tick > 12
    assert bench.loop.state.mode is Mode.OFF
    bench.turn(bench.loop.tick + 1, bench.loop.tick + 2)
    assert bench.loop.state.mode is Mode.MOTORING


def test_a_controller_that_comes_up_late_leaves_a_start_of_long_ago_alone():
    start = OperatorCommand("start")
    for first, mode in ((500, Mode.MOTORING), (5000, Mode.OFF)):
        bench = Bench({100: start}, running=False)
        bench.turn(first, first + 1)
        assert bench.loop.state.mode is mode
