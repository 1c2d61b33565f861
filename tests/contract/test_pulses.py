"""Pulses have one meaning: the plant's model and the output lines make the same edges of frames.

The plant's loop and the driver of the lines are given the same answers at the same times; every
edge of every channel has to come at the same nanosecond.
"""

from collections import deque
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from drivers.gpio.process import EdgeDriver
from drivers.recorder.client import NullRecorder
from hil import ports
from hil.config.hardware import OutputsConfig
from hil.config.plant import PlantConfig
from hil.config.ranges import stale_ticks
from hil.pacing import RealTimePacer
from hil.values import replace
from hil.wire import pulses
from hil.wire.codec import FRAME, Encoder
from hil.wire.e2e import ReceptionCounts
from hil.wire.messages import CHANNELS, OPERATING_MODES, ControllerTick, MachineCommand, Pulse
from plant.build import plant_params
from plant.loop import PlantLoop
from plant.rig.actuation import Actuation
from plant.rig.beginning import initial_state

pytestmark = pytest.mark.interpreted("watches the table of pulses from inside")

US, MS = 1000, 1_000_000
PERIOD_NS = MS
STALE_TICKS = stale_ticks(PlantConfig().stale_s, PERIOD_NS)
EPOCH_NS = 77_000 * MS
"""Where the plant's time begins on the monotonic clock."""

OFF, MOTORING, GENERATING, STOPPING, SAFE = OPERATING_MODES
INJECTOR, OTHER_INJECTOR, SPARK, OTHER_SPARK, VALVE = 0, 1, 2, 3, 5
OUTPUTS = OutputsConfig(
    chip="/dev/gpiochip9", lines={name: number for number, name in CHANNELS.items()}, late_us=0
)


class Answer(NamedTuple):
    """One answer of the controller, on the plant's clock; `arrives` false: lost on both ways."""

    tick: int
    mode: int
    sent: tuple[Pulse, ...] = ()
    after_us: int = 300
    arrives: bool = True
    has_head: bool = True

    @property
    def t_ns(self):
        return self.tick * PERIOD_NS + self.after_us * US


def pulse(channel, open_us, duration_us):
    return Pulse(channel, open_us % 2**20, duration_us)


class Unprotected:
    """A codec that carries messages as they are, and so what the wire has no place for."""

    def __init__(self):
        self.kept = []

    def encode(self, messages):
        self.kept.append(messages)
        return bytes([len(self.kept) - 1])

    def decode(self, batch):
        return list(self.kept[batch[0]])

    def forget_counters(self):
        """There are none."""

    def counts(self):
        return ReceptionCounts()


def encoded(answers, encoder):
    """(time of sending, tick, frames) of what arrives."""
    batches = []
    for answer in answers:
        head = ControllerTick(answer.tick, min(2 + len(answer.sent), 7), answer.mode)
        machine = MachineCommand(2, 0.0, 800.0, 1.0)
        batch = encoder.encode((head, machine, *answer.sent))
        if answer.arrives:
            cut = 0 if answer.has_head else FRAME.size
            batches.append((answer.t_ns, answer.tick, batch[cut:]))
    return batches


class Port(ports.Link):
    """The link of a plant that is watched from inside."""

    def __init__(self):
        self.inbox = deque()

    def send(self, _batch):
        pass

    def receive(self):
        return self.inbox.popleft() if self.inbox else None

    def peer_alive(self):
        return True


class Unseen(ports.StatusSink):
    def publish(self, _status):
        pass


class Clock(ports.Clock):
    """Time passes by sleeping only."""

    t_ns = 0

    def now_ns(self):
        return self.t_ns

    def sleep_until(self, deadline_ns):
        self.t_ns = max(self.t_ns, deadline_ns)


def of_the_plant(batches, ticks, decoder=None):
    """The edges of each line in the plant's model."""
    edges = {channel: [] for channel in CHANNELS}
    advance = pulses.advance

    def watched(table, to_ns):
        table, found = advance(table, to_ns)
        for edge in found:
            edges[edge.channel].append((edge.t_ns, edge.high))
        return table, found

    params = plant_params(PlantConfig(), PERIOD_NS)
    state, _ = initial_state(params)
    state = replace(
        state, tick=ticks.start, pulses=Actuation(pulses.lines_for(len(CHANNELS)))
    )  # fmt: skip
    port, waiting = Port(), deque(batches)
    pacer = RealTimePacer(Clock(), PERIOD_NS)
    loop = PlantLoop(
        params, state, link=port, pacer=pacer, recorder=NullRecorder(), status=Unseen(),
        status_every=1000,
    )  # fmt: skip
    loop.answers.decoder = decoder or loop.answers.decoder
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pulses, "advance", watched)
        for tick in ticks:
            while waiting and waiting[0][0] <= tick * PERIOD_NS:
                port.inbox.append(waiting.popleft()[2])
            assert loop.turn(tick) == tick + 1
    return edges


class Chip:
    """Lines that note when they change."""

    channels = frozenset(CHANNELS)

    def __init__(self):
        self.now_ns = 0
        self.edges = {channel: [] for channel in CHANNELS}

    def set(self, channel, high):
        self.edges[channel].append((self.now_ns - EPOCH_NS, high))

    def all_low(self):
        pass

    def close(self):
        pass


def of_the_lines(batches, ticks, decoder=None):
    """The edges of each line of a chip whose process is always in time."""
    chip = Chip()
    driver = EdgeDriver(chip, OUTPUTS, PERIOD_NS, STALE_TICKS)
    driver._decoder = decoder or driver._decoder

    def act_until(t_ns):
        while chip.now_ns < t_ns:
            chip.now_ns = min(max(driver.act(chip.now_ns), chip.now_ns), t_ns)

    chip.now_ns = EPOCH_NS + ticks.start * PERIOD_NS
    for t_ns, tick, batch in batches:
        act_until(EPOCH_NS + t_ns)
        driver.take(EPOCH_NS + tick * PERIOD_NS, EPOCH_NS + t_ns, batch)
    act_until(EPOCH_NS + ticks.stop * PERIOD_NS)
    driver.act(chip.now_ns)
    assert driver.late == 0
    return chip.edges


def agreed(*answers, first=0, codec=None):
    """The edges on which both agree, by channel, in us; an empty answer begins, silence ends."""
    batches = encoded((Answer(first, GENERATING, after_us=0), *answers), codec or Encoder())
    last = max([first, *(answer.t_ns // PERIOD_NS for answer in answers)])
    ticks = range(first, last + STALE_TICKS + 80)
    model, lines = of_the_plant(batches, ticks, codec), of_the_lines(batches, ticks, codec)
    assert model == lines
    return {c: [(t_ns / US, high) for t_ns, high in found] for c, found in lines.items() if found}


def in_every_tick(ticks, mode, *sent):
    return [Answer(tick, mode, sent) for tick in ticks]


@pytest.mark.parametrize("mode", OPERATING_MODES)
def test_lines_are_high_in_the_modes_that_fire_only(mode):
    orders = [pulse(INJECTOR, 3_000, 2_500), pulse(SPARK, 4_100, 500), pulse(VALVE, 2_000, 9_000)]
    edges = agreed(*in_every_tick(range(1, 14), mode, *orders))
    if mode in (MOTORING, GENERATING):
        assert edges == {
            INJECTOR: [(3_000, True), (5_500, False)],
            SPARK: [(4_100, True), (4_600, False)],
            VALVE: [(2_000, True), (11_000, False)],
        }
    else:
        assert edges == {}


@pytest.mark.parametrize("before", OPERATING_MODES)
@pytest.mark.parametrize("after", OPERATING_MODES)
def test_a_change_of_mode_closes_what_is_open_and_withholds_what_is_due_later(before, after):
    """The injector is open, and a spark is due 4 ms after the change; the orders go on coming."""
    orders = (pulse(INJECTOR, 3_200, 9_000), pulse(SPARK, 10_000, 500))
    edges = agreed(
        *in_every_tick(range(1, 5), before, *orders), *in_every_tick(range(5, 15), after, *orders)
    )
    fired, fires = (mode in (MOTORING, GENERATING) for mode in (before, after))
    if fired:
        assert edges[INJECTOR] == [(3_200, True), (12_200 if fires else 6_000, False)]
    assert (SPARK in edges) == fires


def test_what_was_ordered_before_goes_no_further_when_the_frames_say_stopping_and_no_more():
    edges = agreed(
        *in_every_tick(range(1, 3), GENERATING, pulse(INJECTOR, 2_500, 9_000),
                       pulse(OTHER_SPARK, 8_000, 500)),
        *in_every_tick(range(4, 6), STOPPING), *in_every_tick(range(6, 16), OFF),
    )  # fmt: skip
    assert edges == {INJECTOR: [(2_500, True), (5_000, False)]}


def test_a_pulse_that_was_cut_is_not_taken_up_again():
    order = pulse(INJECTOR, 2_500, 9_000)
    edges = agreed(
        *in_every_tick(range(1, 4), GENERATING, order), Answer(4, SAFE, (order,)),
        *in_every_tick(range(5, 12), GENERATING, order),
    )  # fmt: skip
    assert edges == {INJECTOR: [(2_500, True), (5_000, False)]}


def test_a_newer_order_moves_the_closing_of_an_open_pulse_and_what_is_to_come():
    edges = agreed(
        *in_every_tick(range(1, 4), GENERATING, pulse(INJECTOR, 2_500, 4_000),
                       pulse(SPARK, 7_000, 500)),
        *in_every_tick(range(4, 9), GENERATING, pulse(INJECTOR, 2_500, 3_300),
                       pulse(SPARK, 6_900, 400)),
    )  # fmt: skip
    assert edges == {
        INJECTOR: [(2_500, True), (5_800, False)],
        SPARK: [(6_900, True), (7_300, False)],
    }


@pytest.mark.parametrize(
    "orders",
    [
        [pulse(INJECTOR, 1_700, 500)],  # late: the answer acts at 2 ms
        [pulse(INJECTOR, -200_000, 500)],
        [pulse(INJECTOR, 3_000, 20_001)],  # too long
        [pulse(INJECTOR, 600_000, 500)],  # too far ahead
    ],
)
def test_a_refused_order_moves_no_line(orders):
    assert agreed(*in_every_tick(range(1, 8), GENERATING, *orders)) == {}


def test_of_two_pulses_that_contradict_each_other_or_overlap_the_first_is_kept():
    edges = agreed(
        *in_every_tick(range(1, 3), GENERATING, pulse(INJECTOR, 3_000, 2_000),
                       pulse(INJECTOR, 3_500, 2_000)),
        *in_every_tick(range(3, 8), GENERATING, pulse(INJECTOR, 4_500, 2_000)),
    )  # fmt: skip
    assert edges == {INJECTOR: [(3_000, True), (5_000, False)]}


def test_a_pulse_goes_across_the_turn_of_the_clock():
    wrap_us = 2**20
    orders = (pulse(INJECTOR, wrap_us - 700, 2_000), pulse(SPARK, wrap_us + 900, 500))
    edges = agreed(*in_every_tick(range(1041, 1053), GENERATING, *orders), first=1040)
    assert edges == {
        INJECTOR: [(wrap_us - 700, True), (wrap_us + 1_300, False)],
        SPARK: [(wrap_us + 900, True), (wrap_us + 1_400, False)],
    }


def test_silence_shuts_both_at_the_plants_limit():
    """The last answer acts at 4 ms; one whose head was lost counts for nothing."""
    orders = (pulse(VALVE, 2_500, 60_000), pulse(SPARK, 20_000, 500))
    last = Answer(5, GENERATING, orders, has_head=False)
    edges = agreed(*in_every_tick(range(1, 4), GENERATING, *orders), last)
    assert edges == {VALVE: [(2_500, True), (4_000 + STALE_TICKS * 1_000, False)]}


def test_answers_to_several_samples_in_one_tick_are_one():
    """The mode is that of the newest, and a pulse counts unless its channel is ordered anew."""
    edges = agreed(
        Answer(1, STOPPING, (pulse(INJECTOR, 4_500, 300), pulse(SPARK, 5_000, 300)), 1_200),
        Answer(2, GENERATING, (pulse(SPARK, 5_500, 300),), 250),
    )
    assert edges == {
        INJECTOR: [(4_500, True), (4_800, False)],
        SPARK: [(5_500, True), (5_800, False)],
    }


def test_a_pulse_may_be_taken_back():
    """A duration of nought is none that the wire carries, but both sides know what it means."""
    edges = agreed(
        Answer(1, GENERATING, (pulse(INJECTOR, 3_000, 3_000), pulse(SPARK, 7_000, 500))),
        Answer(3, GENERATING, (pulse(INJECTOR, 3_000, 0), pulse(SPARK, 7_000, 0))),
        codec=Unprotected(),
    )
    assert edges == {INJECTOR: [(3_000, True), (4_000, False)]}


shots = st.tuples(
    st.sampled_from(sorted(CHANNELS)),
    st.sampled_from([*range(-2_000, 9_000, 500), 777, -300_000, 520_000, 530_000, 790_000]),
    st.sampled_from([1, 300, 500, 1_000, 1_400, 4_000, 21_000]),
)
turns = st.tuples(
    st.sampled_from([GENERATING, GENERATING, GENERATING, MOTORING, STOPPING, SAFE, OFF]),
    st.sampled_from(["new", "again", "again", "none"]),
    st.lists(shots, max_size=3),
    st.sampled_from([1, 300, 999, 1_000, 1_001, 2_400]),
    st.sampled_from(["whole", "whole", "whole", "whole", "no head", "lost", "long silence"]),
)


def script(first, entries):
    """The answers of a controller that orders anew, again or nothing, on a link that may lose."""
    answers, sent, tick, t_us = [], (), first, 0
    for mode, what, fired, after_us, fate in entries:
        tick += 13 if fate == "long silence" else 1
        if what == "new":
            sent = tuple(pulse(c, tick * 1_000 + ahead_us, long) for c, ahead_us, long in fired)
        t_us = max(t_us, tick * 1_000 + after_us)
        answers.append(
            Answer(
                tick, mode, () if what == "none" else sent, t_us - tick * 1_000,
                arrives=fate != "lost", has_head=fate != "no head",
            )
        )  # fmt: skip
    return answers


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from([0, 1_030, 2**20]), st.lists(turns, max_size=25))
@example(0, [(GENERATING, "new", [(0, 1_000, 4_000)], 300, "whole")] * 2)
def test_whatever_is_sent_both_make_the_same_edges_and_end_low(first, entries):
    for edges in agreed(*script(first, entries), first=first).values():
        assert [high for _, high in edges] == [True, False] * (len(edges) // 2)
