"""Modes to machine, planned edges to frames."""

import pytest

from controller.actuator import MAX_PULSES, Machine, machine_for, messages, still_open
from controller.mode.start_restart import Mode
from controller.timing.plan import PlannedPulse
from hil.wire.codec import Decoder, Encoder
from hil.wire.messages import GENERATOR, MOTOR, OFF, ControllerTick, MachineCommand, Pulse

MS = 1_000_000
NONE = (None, None)


def pulse(channel, open_ms, long_ms=1):
    return PlannedPulse(channel, round(open_ms * MS), round(long_ms * MS))


@pytest.mark.parametrize(
    ("mode", "machine"),
    [
        (Mode.OFF, Machine(OFF, 0.0, 0.0)),
        (Mode.GENERATING, Machine(GENERATOR, 0.0, 500.0)),
        (Mode.STOPPING, Machine(GENERATOR, 0.0, 810.0)),
        (Mode.SAFE, Machine(GENERATOR, 0.0, 810.0)),
    ],
)
def test_machine_of_each_mode(mode, machine):
    """In the safe state the load stays on: without it the piston would go on oscillating."""
    assert machine_for(mode, 500.0, 810.0) == machine


def test_pulse_is_sent_again_until_it_has_closed():
    planned = (pulse(0, 5, 3), None)
    sent, pulses = [], ()
    for tick in range(12):
        pulses = still_open(pulses, *(planned if tick == 2 else NONE), tick * MS)
        sent.append(len(pulses))
    assert sent == [0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0]


def test_newly_planned_pulse_replaces_that_of_its_channel_only():
    injection, spark, later = pulse(1, 5, 3), pulse(3, 9), pulse(3, 9.2)
    pulses = still_open((injection, spark), None, later, 4 * MS)
    assert pulses == (injection, later)


def test_pulses_go_out_in_the_order_of_their_openings():
    assert still_open((), pulse(1, 5), pulse(3, 4), 0) == (pulse(3, 4), pulse(1, 5))


def test_an_idle_tick_makes_nothing_new():
    assert still_open((), None, None, 0) == ()


@pytest.mark.parametrize("count", range(5))
def test_a_tick_has_two_pulse_frames_at_the_most_and_says_how_many_there_are(count):
    planned = tuple(pulse(channel, channel) for channel in range(count))
    sent = messages(7, Mode.GENERATING, Machine(GENERATOR, 0.0, 810.0), 1.0, planned)
    assert sent[0] == ControllerTick(7, len(sent), 2)
    assert sent[1] == MachineCommand(GENERATOR, 0.0, 810.0, 1.0)
    assert [m.channel for m in sent[2:]] == list(range(min(count, MAX_PULSES)))


def test_opening_is_in_microseconds_modulo_the_pulse_clock():
    planned = (PlannedPulse(2, ((1 << 20) * 3 + 17) * 1000, 500_000),)
    sent = messages(7, Mode.GENERATING, Machine(GENERATOR), 1.0, planned)
    assert sent[2] == Pulse(2, 17, 500)


@pytest.mark.parametrize("mode", Mode)
def test_every_answer_is_one_that_the_codec_takes(mode):
    motoring = Machine(MOTOR, -110.0)
    machine = motoring if mode is Mode.MOTORING else machine_for(mode, 810.0, 10_000.0)
    sent = messages(2**32 - 1, mode, machine, 0.004, (pulse(0, 5), pulse(3, 2**30)))
    decoded = Decoder("controller").decode(Encoder().encode(sent))
    assert decoded == list(sent)


def test_an_order_that_stands_is_the_same_message_again():
    stands = Machine(GENERATOR, 0.0, 810.0)
    first = messages(7, Mode.GENERATING, stands, 1.0, ())
    again = messages(8, Mode.GENERATING, Machine(GENERATOR, 0.0, 810.0), 1.0, (), first)
    assert again[1] is first[1]
    for machine, throttle in (
        (Machine(MOTOR, 0.0, 810.0), 1.0), (Machine(GENERATOR, 1.0, 810.0), 1.0),
        (Machine(GENERATOR, 0.0, 811.0), 1.0), (stands, 0.5),
    ):  # fmt: skip
        changed = messages(9, Mode.GENERATING, machine, throttle, (), again)
        assert changed == messages(9, Mode.GENERATING, machine, throttle, ())
        assert changed[1] != again[1]
