"""SI to frames and back; what is refused, and how each verdict on a frame is counted."""

import math
import struct

import pytest

from hil.errors import CodecError
from hil.values import replace
from hil.wire.codec import FRAME, Decoder, Encoder, frames_of
from hil.wire.e2e import ReceptionCounts, counter_marks, protect
from hil.wire.fields import LAYOUTS, layout_of
from hil.wire.messages import (
    ControllerTick,
    CylinderPeak,
    MachineCommand,
    PistonSample,
    PlantTick,
    Pulse,
)

NAN = math.nan
HEAD = PlantTick(7, 2, 0, 123.0, NAN, NAN)
SAMPLE = PistonSample(0.0155, -1.5)
MACHINE = MachineCommand(2, 0.0, 810.0, 1.0)


def frame(message, counter, payload=None):
    """One frame as a batch, with the counter of our choice."""
    layout = layout_of(type(message))
    if payload is None:
        ((_, word),) = frames_of(Encoder().encode([message]))
        payload = word & ~0xFFF
    return FRAME.pack(layout.can_id, protect(payload, counter, counter_marks(layout.data_ids)))


def counts_after(*batches, sender="plant"):
    decoder = Decoder(sender)
    decoded = [message for batch in batches for message in decoder.decode(batch)]
    return decoded, decoder.counts()


def test_frames_are_ten_bytes_of_identifier_and_little_endian_word():
    batch = Encoder().encode([SAMPLE])
    can_id, word = struct.unpack("<HQ", batch)
    assert can_id == 0x101
    assert word >> 12 & 0xFFFFFF == 1_550_000
    assert word >> 36 & 0xFFFFFF == (1 << 24) - 1_500_000


def test_messages_of_a_tick_are_one_batch_in_their_order():
    batch = Encoder().encode([HEAD, SAMPLE])
    assert [can_id for can_id, _ in frames_of(batch)] == [0x100, 0x101]
    decoded, counts = counts_after(batch)
    assert [type(message) for message in decoded] == [PlantTick, PistonSample]
    assert counts == ReceptionCounts(ok=2)


def test_only_the_selected_slow_signal_is_on_the_wire():
    (head,), _ = counts_after(Encoder().encode([PlantTick(7, 2, 1, NAN, 250_000.0, NAN)]))
    assert head.p_left_pa == 250_000.0
    assert math.isnan(head.electric_power_w)
    assert math.isnan(head.p_right_pa)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (PistonSample(0.0801, 0.0), r"PistonSample\.x_m = 0\.0801: accepted -0\.08 to 0\.08 m"),
        (PistonSample(0.0, -8.1), r"PistonSample\.v_m_s = -8\.1: accepted -8 to 8 m/s"),
        (PistonSample(NAN, 0.0), r"PistonSample\.x_m = nan: accepted -0\.08 to 0\.08 m"),
        (PistonSample(0.0, math.inf), r"PistonSample\.v_m_s = inf: accepted -8 to 8 m/s"),
        (PistonSample(-math.inf, 0.0), r"PistonSample\.x_m = -inf: accepted -0\.08 to 0\.08"),
        (PlantTick(1, 2, 2, NAN, NAN, NAN), r"PlantTick\.p_right_pa = nan: accepted 0 to"),
        (PlantTick(1, 2, 4, NAN, NAN, NAN), r"PlantTick\.slow = 4: accepted 0 to 3"),
        (PlantTick(1 << 32, 2, 0, 0.0, NAN, NAN), r"PlantTick\.tick = 4294967296: accepted 0 to"),
        (PlantTick(1, 0, 0, 0.0, NAN, NAN), r"PlantTick\.frame_count = 0: accepted 1 to 7"),
        (ControllerTick(1, 2, 5), r"ControllerTick\.mode = 5: accepted 0 to 4"),
        (MachineCommand(3, 0.0, 0.0, 1.0), r"MachineCommand\.mode = 3: accepted 0 to 2"),
        (MachineCommand(1, 5000.1, 0.0, 1.0), r"force_n = 5000\.1: accepted -5000 to 5000 N"),
        (MachineCommand(2, 0.0, -1.0, 1.0), r"load_coefficient_n_s_m = -1\.0: accepted 0 to 10000"),
        (MachineCommand(2, 0.0, 0.0, 1.1), r"MachineCommand\.throttle = 1\.1: accepted 0 to 1"),
        (Pulse(8, 0, 1), r"Pulse\.channel = 8: accepted 0 to 7"),
        (Pulse(0, 1 << 20, 1), r"Pulse\.open_us = 1048576: accepted 0 to 1048575 us"),
        (Pulse(0, 0, 0), r"Pulse\.duration_us = 0: accepted 1 to 1048575 us"),
    ],
)
def test_value_that_does_not_fit_is_refused_with_message_signal_and_range(message, text):
    with pytest.raises(CodecError, match=text) as caught:
        Encoder().encode([message])
    assert "\n" not in str(caught.value)


def test_a_refused_value_spoils_nothing_that_follows():
    encoder, decoder = Encoder(), Decoder("plant")
    assert decoder.decode(encoder.encode([SAMPLE])) == [SAMPLE]
    with pytest.raises(CodecError):
        encoder.encode([PistonSample(NAN, 0.0)])
    assert decoder.decode(encoder.encode([SAMPLE])) == [SAMPLE]


def test_repeated_values_are_told_by_the_counter():
    encoder = Encoder()
    words = [FRAME.unpack(encoder.encode([MACHINE]))[1] for _ in range(17)]
    assert [word >> 8 & 0xF for word in words] == [*range(16), 0]
    assert words[16] == words[0]
    assert len(set(words)) == 16
    decoded, counts = counts_after(*(FRAME.pack(0x201, w) for w in words), sender="controller")
    assert decoded == [MACHINE] * 17
    assert counts == ReceptionCounts(ok=17)


def test_corrupted_frame_is_counted_once_and_not_acted_on():
    can_id, word = FRAME.unpack(frame(SAMPLE, 1))
    decoded, counts = counts_after(frame(SAMPLE, 0), FRAME.pack(can_id, word ^ 1 << 40))
    assert decoded == [SAMPLE]
    assert counts == ReceptionCounts(ok=1, corrupted=1)


def test_repeated_frame_is_counted_once_and_not_acted_on():
    decoded, counts = counts_after(frame(SAMPLE, 3), frame(SAMPLE, 3))
    assert decoded == [SAMPLE]
    assert counts == ReceptionCounts(ok=1, repeated=1)


@pytest.mark.parametrize("behind", range(1, 5))
def test_older_frame_is_counted_once_and_not_acted_on(behind):
    decoded, counts = counts_after(frame(SAMPLE, 10), frame(SAMPLE, 10 - behind))
    assert decoded == [SAMPLE]
    assert counts == ReceptionCounts(ok=1, reordered=1)


@pytest.mark.parametrize("missing", range(1, 11))
def test_frames_that_a_counter_step_skips_are_lost(missing):
    decoded, counts = counts_after(frame(SAMPLE, 14), frame(SAMPLE, (15 + missing) % 16))
    assert decoded == [SAMPLE, SAMPLE]
    assert counts == ReceptionCounts(ok=2, lost=missing)


@pytest.mark.parametrize("can_id", [0, 0x10F, 0x201, 0x7FF])
def test_frame_of_another_sender_or_of_nobody_is_unknown(can_id):
    decoded, counts = counts_after(FRAME.pack(can_id, 0x1234))
    assert decoded == []
    assert counts == ReceptionCounts(unknown=1)


@pytest.mark.parametrize(
    ("message", "sender", "payload"),
    [
        (SAMPLE, "plant", 8_000_001 << 12),
        (SAMPLE, "plant", 0x7FFFFF << 36),
        (CylinderPeak(0, 1e5, 0.0, 0.0), "plant", 0x1FFFF << 28),
        (HEAD, "plant", 0),
        (ControllerTick(1, 2, 0), "controller", 7 << 47 | 1 << 44),
        (MACHINE, "controller", 3 << 12),
        (MACHINE, "controller", 251 << 54),
        (Pulse(0, 0, 1), "controller", 0),
    ],
)
def test_intact_frame_with_a_value_out_of_range_is_counted_and_not_acted_on(
    message, sender, payload
):
    decoded, counts = counts_after(frame(message, 0, payload), sender=sender)
    assert decoded == []
    assert counts == ReceptionCounts(out_of_range=1)


def test_value_out_of_range_stays_refused_when_it_is_repeated():
    bad = [frame(SAMPLE, counter, 8_000_001 << 12) for counter in (1, 2)]
    decoded, counts = counts_after(frame(SAMPLE, 0), *bad, frame(SAMPLE, 3))
    assert decoded == [SAMPLE, SAMPLE]
    assert counts == ReceptionCounts(ok=2, out_of_range=2)


@pytest.mark.parametrize("length", [1, 9])
def test_batch_that_ends_within_a_frame_gives_its_whole_frames_and_is_counted(length):
    decoded, counts = counts_after(frame(SAMPLE, 0) + bytes(length))
    assert decoded == [SAMPLE]
    assert counts == ReceptionCounts(ok=1, incomplete=1)


def test_frames_of_a_broken_batch_are_a_codec_error():
    with pytest.raises(CodecError, match="11 bytes is not a multiple of 10"):
        frames_of(bytes(11))


def test_after_a_silence_any_counter_is_accepted():
    decoder = Decoder("plant")
    decoder.decode(frame(SAMPLE, 10))
    assert decoder.decode(frame(SAMPLE, 7)) == []
    decoder.forget_counters()
    assert decoder.decode(frame(SAMPLE, 7)) == [SAMPLE]
    assert decoder.decode(frame(SAMPLE, 7)) == []


def test_counters_of_the_messages_are_independent():
    encoder = Encoder()
    for _ in range(3):
        encoder.encode([HEAD])
    encoder.encode([SAMPLE])
    assert encoder.counters[0x100] == 2
    assert encoder.counters[0x101] == 0
    assert set(encoder.counters) == set(LAYOUTS)


def test_equal_messages_and_the_same_message_again_are_the_same_frames():
    once, always = Encoder(), Encoder()
    for _ in range(20):
        assert once.encode([MACHINE]) == always.encode([replace(MACHINE)])


def test_a_refused_message_is_never_taken_for_the_one_before():
    encoder, bad = Encoder(), PistonSample(0.0, 8.1)
    encoder.encode([SAMPLE])
    for _ in range(2):
        with pytest.raises(CodecError):
            encoder.encode([bad])
    assert encoder.encode([SAMPLE]) == frame(SAMPLE, 3)


@pytest.mark.parametrize("sender", ["plant", "controller"])
def test_what_was_repeated_before_a_snapshot_is_repeated_after_it(sender):
    message = SAMPLE if sender == "plant" else MACHINE
    decoder, later = Decoder(sender), Decoder(sender)
    decoder.decode(frame(message, 4))
    later.recall(decoder.remember())
    assert later.decode(frame(message, 5)) == [message]
    assert later.decode(frame(message, 5)) == []
    assert later.counts() == ReceptionCounts(ok=2, repeated=1)
