"""The generated frames against the declaration read slowly: field by field, bit by bit."""

import math
import struct
from fractions import Fraction

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.errors import CodecError
from hil.wire import messages
from hil.wire.codec import Decoder, Encoder, frames_of
from hil.wire.e2e import ReceptionCounts, signed, unsigned
from hil.wire.fields import LAYOUTS

assert messages.Pulse in {layout.make for layout in LAYOUTS.values()}
ANY_MACHINE = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
MESSAGES = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)
SENDERS = sorted({layout.sender for layout in LAYOUTS.values()})


def crc(data):
    """CRC-8 0x2F of some bytes, a bit at a time."""
    value = 0xFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x2F if value & 0x80 else value << 1) & 0xFF
    return value ^ 0xFF


def protected(layout, payload, counter):
    """A frame's word with a right CRC."""
    word = payload << 12 | counter << 8
    data = word.to_bytes(8, "little")[1:]
    return word | crc(data + layout.data_ids[counter : counter + 1])


def is_carried(layout, placed, values):
    selector = next((p.name for p in layout.fields if p.signal.selects), None)
    return placed.signal.only_when is None or placed.signal.only_when == values[selector]


def payload_of(layout, values):
    """The 52 bits of a message; None when a value does not fit."""
    payload = 0
    for placed in layout.fields:
        if not is_carried(layout, placed, values):
            continue
        value, signal = values[placed.name], placed.signal
        if not math.isfinite(value / signal.scale):
            return None
        raw = round(value / signal.scale) if placed.is_float else value
        if not signal.raw_range[0] <= raw <= signal.raw_range[1]:
            return None
        payload |= raw % (1 << signal.bits) << placed.start_bit - 12
    return payload


def values_of(layout, payload):
    """What a payload says, nan for what it does not carry; None with a value out of range."""
    values = {}
    for placed in layout.fields:
        signal = placed.signal
        raw = payload >> placed.start_bit - 12 & (1 << signal.bits) - 1
        if signal.signed and raw >> signal.bits - 1:
            raw -= 1 << signal.bits
        if not is_carried(layout, placed, values):
            values[placed.name] = math.nan
            continue
        if not signal.raw_range[0] <= raw <= signal.raw_range[1]:
            return None
        values[placed.name] = raw * signal.scale
    return values


def bits_of(layout, values):
    """Values as text in which a nan is one and every bit counts."""
    return [float(values[placed.name]).hex() for placed in layout.fields]


def told_by(message):
    layout = next(layout for layout in LAYOUTS.values() if layout.make is type(message))
    return layout.name, bits_of(layout, {p.name: getattr(message, p.name) for p in layout.fields})


def values_near(placed):
    """Values in and out of range, ties of the rounding and the ends of the range among them."""
    low, high = placed.signal.raw_range
    if not placed.is_float:
        return st.integers(low - 1, high + 1) | st.sampled_from((low, high))
    scale = placed.signal.scale
    ties = st.integers(low - 1, high).map(
        lambda raw: float((raw + Fraction(1, 2)) * Fraction(scale))
    )
    return ties | st.floats(low * scale, high * scale) | st.floats()


@MESSAGES
@ANY_MACHINE
@given(data=st.data())
def test_a_message_is_packed_as_declared_or_refused(layout, data):
    values = {placed.name: data.draw(values_near(placed), placed.name) for placed in layout.fields}
    payload = payload_of(layout, values)
    encoder = Encoder()
    if payload is None:
        with pytest.raises(CodecError, match=rf"^{layout.name}\.\w+ = .*: accepted "):
            encoder.encode([layout.make(**values)])
        return
    for counter in range(17):
        batch = encoder.encode([layout.make(**values)])
        assert batch == struct.pack("<HQ", layout.can_id, protected(layout, payload, counter % 16))


@MESSAGES
@ANY_MACHINE
@given(payload=st.integers(0, (1 << 52) - 1), counter=st.integers(0, 15))
def test_any_intact_frame_is_read_as_declared(layout, payload, counter):
    decoder = Decoder(layout.sender)
    frame = struct.pack("<HQ", layout.can_id, protected(layout, payload, counter))
    expected = values_of(layout, payload)
    decoded = decoder.decode(frame)
    if expected is None:
        assert decoded == []
        assert decoder.counts() == ReceptionCounts(out_of_range=1)
    else:
        assert [told_by(message) for message in decoded] == [
            (layout.name, bits_of(layout, expected))
        ]
        assert decoder.counts() == ReceptionCounts(ok=1)


class SlowDecoder:
    """The verdicts of E2E profile 2, as its table reads."""

    def __init__(self, sender):
        self.layouts = {i: layout for i, layout in LAYOUTS.items() if layout.sender == sender}
        self.last = {}
        self.counts = dict.fromkeys(ReceptionCounts._fields, 0)

    def decode(self, batch):
        whole, rest = divmod(len(batch), 10)
        self.counts["incomplete"] += bool(rest)
        frames = [struct.unpack_from("<HQ", batch, 10 * i) for i in range(whole)]
        return [told for told in (self._judge(*frame) for frame in frames) if told]

    def _judge(self, can_id, word):
        verdict, told = self._verdict(can_id, word)
        self.counts[verdict] += 1
        return told

    def _verdict(self, can_id, word):
        layout = self.layouts.get(can_id)
        if layout is None:
            return "unknown", None
        counter = word >> 8 & 15
        if protected(layout, word >> 12, counter) != word:
            return "corrupted", None
        if can_id in self.last:
            delta = (counter - self.last[can_id]) % 16
            if delta in {0, *range(12, 16)}:
                return "reordered" if delta else "repeated", None
            self.counts["lost"] += delta - 1
        self.last[can_id] = counter
        values = values_of(layout, word >> 12)
        if values is None:
            return "out_of_range", None
        return "ok", (layout.name, bits_of(layout, values))


def frames(sender):
    """Frames of few payloads and counters, so that they repeat; some damaged, some nobody's."""
    own = [layout for layout in LAYOUTS.values() if layout.sender == sender]
    payloads = st.sampled_from((0, 1 << 32, 1 << 51, (1 << 52) - 1, 1 << 32 | 1 << 35, 1))
    intact = st.builds(
        lambda layout, payload, counter: (layout.can_id, protected(layout, payload, counter)),
        st.sampled_from(own), payloads | st.integers(0, (1 << 52) - 1), st.integers(0, 15),
    )  # fmt: skip
    damaged = st.tuples(intact, st.integers(0, 63)).map(
        lambda pair: (pair[0][0], pair[0][1] ^ 1 << pair[1])
    )
    return intact | intact | damaged | st.tuples(st.integers(0, 0xFFFF), st.integers(0, 2**64 - 1))


@pytest.mark.parametrize("sender", SENDERS)
@ANY_MACHINE
@given(data=st.data())
def test_any_stream_of_frames_gets_the_verdicts_of_the_profile(sender, data):
    stream = data.draw(st.lists(frames(sender), max_size=60))
    ours, theirs = Decoder(sender), SlowDecoder(sender)
    for frame in stream:
        batch = struct.pack("<HQ", *frame) + data.draw(st.sampled_from((b"", b"", b"\0" * 9)))
        assert [told_by(message) for message in ours.decode(batch)] == theirs.decode(batch)
        assert ours.counts()._asdict() == theirs.counts


@pytest.mark.parametrize("sender", SENDERS)
@ANY_MACHINE
@given(data=st.data())
def test_a_decoder_goes_on_from_what_it_remembered(sender, data):
    before, after = (data.draw(st.lists(frames(sender), max_size=20)) for _ in range(2))
    first, second = Decoder(sender), Decoder(sender)
    first.decode(b"".join(struct.pack("<HQ", *frame) for frame in before))
    memory = first.remember()
    assert all(bare == -1 or 0 <= bare < 1 << 64 for _, bare in memory.streams)
    second.recall(memory)
    assert second.remember() == memory
    rest = b"".join(struct.pack("<HQ", *frame) for frame in after)
    assert list(map(told_by, second.decode(rest))) == list(map(told_by, first.decode(rest)))
    assert second.remember() == first.remember()


@given(st.integers(0, 2**64 - 1))
def test_a_word_is_the_same_signed_and_unsigned(word):
    assert unsigned(signed(word)) == word
    assert struct.pack("<q", signed(word)) == struct.pack("<Q", word)


def test_an_unused_frame_of_a_new_decoder_is_never_taken_for_a_repeated_one():
    """A word that looks like the mark of no frame at all is judged like any other."""
    for layout in LAYOUTS.values():
        for counter in range(16):
            word = protected(layout, (1 << 52) - 1, counter) ^ 0xF00
            ours, theirs = Decoder(layout.sender), SlowDecoder(layout.sender)
            batch = struct.pack("<HQ", layout.can_id, word)
            assert len(list(frames_of(batch))) == 1
            assert [told_by(message) for message in ours.decode(batch)] == theirs.decode(batch)
            assert ours.counts()._asdict() == theirs.counts
