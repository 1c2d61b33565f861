"""The plant's turn with every port in the test's hand: when an answer acts, and when none comes."""

from collections import UserList, deque

import pytest

from hil import ports
from hil.config.plant import PlantConfig
from hil.errors import RunError
from hil.log import topics
from hil.log.records import MESSAGE_HEAD, PAYLOAD_OFFSET
from hil.pacing import LockstepPacer, RealTimePacer
from hil.wire.codec import Decoder, Encoder
from hil.wire.messages import OPERATING_MODES, ControllerTick, MachineCommand, Pulse
from plant.build import plant_params
from plant.loop import PlantLoop
from plant.rig.beginning import initial_state
from plant.status import raise_if_lost

MS = 1_000_000
FUEL = 2.8185e-6
OFF, MOTORING, GENERATING, STOPPING, SAFE = OPERATING_MODES
TOPICS = {topic.channel_id: topic for topic in topics.ALL}


class Link(ports.Link):
    """The controller's end is `inbox`; `on_send` is its turn."""

    def __init__(self):
        self.inbox, self.sent, self.alive = deque(), [], True
        self.on_send = lambda: None

    def send(self, batch):
        self.sent.append(batch)
        self.on_send()

    def receive(self):
        return self.inbox.popleft() if self.inbox else None

    def wait(self, _timeout_ns):
        return self.receive()

    def peer_alive(self):
        return self.alive


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


class Status(ports.StatusSink):
    def publish(self, status):
        """Nobody looks."""


class Clock(ports.Clock):
    """Time passes only by sleeping, and by `late_ns` once."""

    def __init__(self):
        self.t_ns = 1000 * MS

    def now_ns(self):
        return self.t_ns

    def sleep_until(self, deadline_ns):
        self.t_ns = max(self.t_ns, deadline_ns)


class Bench:
    """A plant loop, and a controller's encoder to answer it."""

    def __init__(self, realtime=False, stale_s=0.010, rearm=False):
        self.params = plant_params(PlantConfig(stale_s=stale_s), MS, rearm=rearm)
        self.clock = Clock()
        pacer = RealTimePacer(self.clock, MS) if realtime else LockstepPacer(MS, 10 * MS)
        self.link, self.log, self.encoder = Link(), Log(), Encoder()
        state, events = initial_state(self.params, FUEL, 810.0)
        self.loop = PlantLoop(
            self.params, state, events, link=self.link, pacer=pacer, recorder=self.log,
            status=Status(), status_every=100,
        )  # fmt: skip
        self.tick = 0

    def answer(self, tick, load=810.0, *pulses, mode=GENERATING, throttle=1.0):
        """Put an answer on the link."""
        head = ControllerTick(tick, 2 + len(pulses), mode)
        machine = MachineCommand(2, 0.0, load, throttle)
        self.link.inbox.append(self.encoder.encode((head, machine, *pulses)))

    def turn(self, count=1):
        for _ in range(count):
            self.tick = self.loop.turn(self.tick)
        return self.tick

    @property
    def load(self):
        return self.loop.state.machine.load_coefficient_n_s_m

    def loads(self):
        """Load that acted in each tick, as logged at the start of the next."""
        return [t["load_coefficient_n_s_m"] for t in self.log.of("/truth")][1:]


@pytest.mark.parametrize("realtime", [False, True])
def test_answer_to_tick_k_acts_from_tick_k_plus_1(realtime):
    """Even when the answer is there before the plant has integrated tick k."""
    bench = Bench(realtime)
    loads = [700.0, 600.0, 500.0, 400.0]
    bench.link.on_send = lambda: bench.answer(bench.tick, loads[bench.tick])
    bench.turn(4)
    assert bench.loads() == [810.0, 700.0, 600.0]
    assert bench.load == 500.0
    assert [t["used_tick"] for t in bench.log.of("/timing")][1:] == [0, 1, 2]


def test_late_answer_acts_in_the_first_tick_after_it_has_come():
    bench = Bench(realtime=True)
    bench.turn()
    bench.answer(0)
    bench.turn(3)
    assert bench.loop.state.stale == 2
    bench.answer(1, 500.0)
    bench.turn()
    assert bench.load == 500.0
    assert bench.loop.state.stale == 0
    assert bench.log.of("/timing")[-1]["used_tick"] == 1


def test_of_several_answers_in_one_tick_the_newest_machine_order_counts():
    bench = Bench(realtime=True)
    bench.turn()
    for tick, load in enumerate((700.0, 600.0, 500.0)):
        bench.answer(tick, load)
    bench.turn()
    assert bench.load == 500.0
    assert bench.log.of("/timing")[-1]["used_tick"] == 2
    assert [len(f["data"]) for f in bench.log.of("/frames/received")] == [20, 20, 20]


def test_of_several_answers_in_one_tick_the_newest_pulse_of_a_channel_counts():
    bench = Bench(realtime=True)
    bench.turn()
    bench.answer(0, 810.0, Pulse(1, 9_000, 3_000), Pulse(3, 20_000, 500))
    bench.answer(1, 810.0, Pulse(3, 20_100, 500))
    bench.turn()
    lines = bench.loop.state.pulses.table.lines
    assert lines[3].pending.open_ns == 20_100_000
    assert lines[1].pending.open_ns == 9_000_000
    assert "pulse-refused" not in bench.log.codes()


@pytest.mark.parametrize("realtime", [False, True])
def test_silence_beyond_its_time_leads_to_the_safe_state_with_its_reason(realtime):
    bench = Bench(realtime)
    bench.turn()
    bench.answer(0, 400.0, Pulse(1, 15_000, 3_000))
    bench.turn()
    assert bench.load == 400.0
    bench.turn(10)
    assert bench.load == 400.0
    assert "safe-state" not in bench.log.codes()
    bench.turn()
    assert bench.load == 810.0
    (event,) = [e for e in bench.log.of("/event") if e["code"] == "safe-state"]
    assert (event["tick"], event["severity"]) == (12, topics.FAULT)
    assert "no valid command for 11 ms" in event["text"]
    assert all(line.pending is None for line in bench.loop.state.pulses.table.lines)


def test_plant_comes_to_rest_without_its_controller():
    bench = Bench()
    bench.turn()
    bench.answer(0)
    bench.turn(2000)
    assert not bench.loop.state.moving
    assert bench.log.codes()[-1] == "at-rest"
    with pytest.raises(RunError, match="controller lost: no valid command in the last"):
        raise_if_lost(bench.loop)


@pytest.mark.parametrize("how", ["silent", "gone"])
def test_controller_that_never_answers_is_a_lost_one_too(how):
    bench = Bench()
    bench.link.alive = how == "silent"
    bench.turn(30)
    assert "safe-state" in bench.log.codes()
    with pytest.raises(RunError, match="controller never answered"):
        raise_if_lost(bench.loop)


def test_in_real_time_a_controller_may_take_a_while_to_come_up():
    bench = Bench(realtime=True)
    bench.turn(500)
    assert bench.loop.state.stale == 0
    bench.answer(499, 500.0)
    bench.turn()
    assert bench.load == 500.0
    raise_if_lost(bench.loop)


def test_in_real_time_a_controller_may_not_take_for_ever_to_come_up():
    bench = Bench(realtime=True)
    bench.turn(1012)
    assert "safe-state" in bench.log.codes()


def test_in_lockstep_a_lost_controller_is_waited_for_only_once():
    bench = Bench()
    bench.turn()
    waits = []
    bench.link.wait = waits.append
    bench.turn(20)
    assert len(waits) == 1


def silenced(**given):
    """A plant that has gone to its safe state at tick 15, its controller generating till then."""
    bench = Bench(**given)
    bench.turn()
    bench.answer(0)
    bench.turn(15)
    assert bench.log.codes()[-1] == "safe-state"
    return bench


def test_answers_that_return_do_not_end_the_safe_state():
    bench = silenced()
    for tick in range(15, 200):
        bench.answer(tick, 500.0, Pulse(1, (tick * 1000 + 5000) % 2**20, 3_000))
        bench.turn()
    assert bench.load == 810.0
    assert "safe-state-left" not in bench.log.codes()
    assert all(line.pending is None for line in bench.loop.state.pulses.table.lines)


@pytest.mark.parametrize("rest", [OFF, STOPPING, SAFE])
def test_a_start_of_the_controller_ends_the_safe_state(rest):
    bench = silenced()
    bench.answer(14, 300.0, mode=rest)
    bench.turn()
    assert bench.load == 810.0
    bench.answer(15, 500.0, mode=MOTORING)
    bench.turn()
    assert bench.load == 500.0
    assert bench.log.codes()[-1] == "safe-state-left"


def test_a_silence_after_the_rest_shuts_the_latch_again():
    bench = silenced()
    bench.answer(14, mode=SAFE)
    bench.turn(20)
    bench.answer(35, 500.0, mode=GENERATING)
    bench.turn()
    assert bench.load == 810.0


def test_rearming_is_an_option_that_the_log_names():
    bench = silenced(rearm=True)
    bench.answer(14, 500.0)
    bench.turn()
    assert bench.load == 500.0
    assert "safety.rearm" in bench.log.of("/event")[-1]["text"]


def test_an_answer_that_has_waited_too_long_is_not_acted_on():
    """A frozen controller answers its backlog; what it wanted then is not wanted now."""
    bench = Bench(realtime=True)
    bench.turn()
    bench.answer(0)
    bench.turn(12)
    bench.answer(1, 500.0)
    bench.turn()
    assert (bench.load, bench.loop.answers.stale) == (810.0, 1)


def unheard_after(bench):
    return Decoder("plant").decode(bench.link.sent[-1])[1].unheard


def test_the_sample_says_for_how_long_nothing_was_heard():
    bench = Bench()
    bench.turn()
    bench.answer(0)
    bench.turn()
    told = []
    for _ in range(13):
        bench.turn()
        told.append(unheard_after(bench))
    assert told == [0, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 15, 15]
    bench.answer(14, mode=SAFE)
    bench.turn(2)
    assert unheard_after(bench) == 15


def test_safe_mode_of_the_controller_forces_every_line_low():
    bench = Bench()
    bench.turn()
    bench.answer(0, 810.0, Pulse(1, 500, 9_000), Pulse(3, 20_000, 500))
    bench.turn()
    bench.answer(1, 810.0, Pulse(1, 500, 9_000))
    bench.turn()
    assert bench.loop.state.pulses.table.lines[3].pending is not None
    bench.answer(2, 810.0, Pulse(1, 500, 9_000), mode=SAFE)
    bench.turn()
    for line in bench.loop.state.pulses.table.lines:
        assert line.open is None
        assert line.pending is None


@pytest.mark.parametrize("junk", [b"", b"x" * 7, bytes(20), b"\xff" * 33])
def test_whatever_comes_over_the_link_counts_as_no_answer(junk):
    bench = Bench()
    bench.turn()
    bench.answer(0)
    bench.turn()
    bench.link.inbox.append(junk)
    bench.turn()
    assert bench.loop.state.stale == 1
    bench.answer(2, 500.0)
    bench.turn()
    assert bench.load == 500.0


def test_answer_whose_head_is_broken_is_not_acted_on():
    bench = Bench()
    bench.turn()
    bench.answer(0)
    bench.turn()
    bench.answer(1, 500.0)
    broken = bytearray(bench.link.inbox.pop())
    broken[4] ^= 1
    bench.link.inbox.append(bytes(broken))
    bench.turn()
    assert bench.load == 810.0
    assert bench.loop.state.stale == 1


@pytest.mark.parametrize("lost", [7, 8, 9, 12, 15])
def test_answer_after_a_long_silence_is_accepted_at_once(lost):
    """The counter has four bits: after so many lost frames it says nothing any more."""
    bench = Bench(realtime=True, stale_s=1.0)
    bench.turn()
    bench.answer(0)
    bench.turn()
    for tick in range(1, 1 + lost):
        bench.answer(tick)
        bench.link.inbox.clear()
        bench.turn()
    bench.answer(1 + lost, 500.0)
    bench.turn()
    assert bench.load == 500.0


def test_controller_that_repeats_itself_is_a_lost_one():
    bench = Bench(realtime=True)
    bench.turn()
    bench.answer(0, 500.0)
    stuck = bench.link.inbox[0]
    bench.turn()
    for _ in range(12):
        bench.link.inbox.append(stuck)
        bench.turn()
    assert "safe-state" in bench.log.codes()


@pytest.mark.parametrize("missed", [1, 3, 8, 20])
def test_skipped_ticks_are_integrated_and_marked_and_nothing_is_sent_for_them(missed):
    bench = Bench(realtime=True)
    bench.turn(2)
    sent = len(bench.link.sent)
    bench.clock.t_ns += (1 + missed) * MS
    bench.turn()
    assert len(bench.link.sent) == sent + 1
    timing = bench.log.of("/timing")
    assert [t["tick"] for t in timing] == list(range(3 + missed))
    assert [t["missed"] for t in timing] == [0, 0] + [1] * missed + [0]
    assert [t["tick"] for t in bench.log.of("/truth")] == list(range(3 + missed))
    assert bench.loop.state.tick == 3 + missed


@pytest.mark.parametrize("missed", [1, 8, 12, 20])
def test_controller_takes_the_first_sample_after_an_overrun(missed):
    """Only what was sent counts: a stall must not look like frames out of order."""
    bench = Bench(realtime=True)
    bench.turn(2)
    bench.clock.t_ns += (1 + missed) * MS
    bench.turn(2)
    decoder = Decoder("plant")
    ticks = [decoder.decode(batch)[0].tick for batch in bench.link.sent]
    assert ticks == [0, 1, 2 + missed, 3 + missed]
    assert decoder.counts().reordered == 0


def test_engine_moves_through_skipped_ticks_as_through_any():
    smooth, torn = Bench(realtime=True), Bench(realtime=True)
    smooth.turn(12)
    torn.turn(2)
    torn.clock.t_ns += 6 * MS
    torn.turn(12 - torn.turn())
    assert torn.loop.state.tick == smooth.loop.state.tick
    assert torn.loop.state.x_m == smooth.loop.state.x_m


def test_log_says_what_was_ordered_and_when_it_acts():
    bench = Bench()
    bench.turn()
    bench.answer(0, 700.0, Pulse(1, 5_000, 3_000), throttle=0.8)
    bench.turn()
    (order,) = bench.log.of("/actuator")
    assert (order["tick"], order["answers_tick"]) == (1, 0)
    assert order["load_coefficient_n_s_m"] == 700.0
    assert order["throttle"] == pytest.approx(0.8)
    assert order["pulse_count"] == 1
    assert order["pulse_open_t_ns"][0] == 5_000_000
    assert order["pulse_duration_ns"][0] == 3_000_000


def test_frames_carry_each_slow_signal_in_its_turn():
    bench = Bench(realtime=True)
    bench.turn(8)
    decoder = Decoder("plant")
    heads = [decoder.decode(batch)[0] for batch in bench.link.sent]
    assert [head.slow for head in heads] == [0, 1, 0, 2, 0, 1, 0, 2]
    assert heads[1].p_left_pa > 1e5
