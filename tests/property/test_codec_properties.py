"""The codec for every value that a signal can have, against itself and against the DBC file."""

import math

import cantools
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.dev.dbc import dbc_text
from hil.wire import messages
from hil.wire.codec import FRAME, Decoder, Encoder, frames_of
from hil.wire.fields import LAYOUTS

assert messages.Pulse in {layout.make for layout in LAYOUTS.values()}
# How long an example takes says something of the machine, not of the codec.
ANY_MACHINE = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
MESSAGES = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)


@pytest.fixture(scope="module")
def database():
    return cantools.database.load_string(dbc_text(), "dbc")


def values(placed):
    low, high = placed.signal.raw_range
    if not placed.is_float:
        return st.integers(low, high)
    scale = placed.signal.scale
    return st.floats(low * scale, high * scale)


def any_message(data, layout):
    fields = {placed.name: data.draw(values(placed), placed.name) for placed in layout.fields}
    selector = next((p.name for p in layout.fields if p.signal.selects), None)
    for placed in layout.fields:
        if placed.signal.only_when not in {None, fields.get(selector)}:
            fields[placed.name] = math.nan
    return layout.make(**fields)


def coded(layout, message):
    batch = Encoder().encode([message])
    (decoded,) = Decoder(layout.sender).decode(batch)
    return batch, decoded


@MESSAGES
@ANY_MACHINE
@given(data=st.data())
def test_round_trip_is_within_half_a_scale_step(layout, data):
    message = any_message(data, layout)
    _, decoded = coded(layout, message)
    for placed in layout.fields:
        sent, got = getattr(message, placed.name), getattr(decoded, placed.name)
        if math.isnan(sent):
            assert math.isnan(got)
        else:
            assert abs(got - sent) <= placed.signal.scale * (0.5 + 1e-6) * placed.is_float


@MESSAGES
@ANY_MACHINE
@given(data=st.data())
def test_what_was_decoded_encodes_to_the_same_frame(layout, data):
    batch, decoded = coded(layout, any_message(data, layout))
    assert Encoder().encode([decoded]) == batch


@MESSAGES
@ANY_MACHINE
@given(data=st.data())
def test_cantools_reads_the_same_from_the_dbc_file(layout, data, database):
    batch, decoded = coded(layout, any_message(data, layout))
    ((can_id, word),) = frames_of(batch)
    theirs = database.decode_message(can_id, word.to_bytes(8, "little"), decode_choices=False)
    ours = {
        placed.name: getattr(decoded, placed.name)
        for placed in layout.fields
        if not math.isnan(getattr(decoded, placed.name))
    }
    assert theirs.pop("e2e_crc") == word & 0xFF
    assert theirs.pop("e2e_counter") == word >> 8 & 0xF
    assert theirs == pytest.approx(ours, rel=1e-12, abs=1e-300)
    assert set(theirs) == set(ours)


@ANY_MACHINE
@given(batch=st.binary(max_size=80))
def test_whatever_arrives_is_judged_and_never_raises(batch):
    decoder = Decoder("plant")
    decoded = decoder.decode(batch)
    counts = decoder.counts()
    assert sum(counts) - counts.lost == len(batch) // FRAME.size + bool(len(batch) % FRAME.size)
    assert len(decoded) == counts.ok


@ANY_MACHINE
@given(st.lists(st.integers(0, 15), max_size=40))
def test_every_frame_has_exactly_one_verdict(kept):
    """Frames of a stream, in any order and number: ok, repeated or reordered, none twice."""
    encoder, decoder = Encoder(), Decoder("plant")
    stream = [encoder.encode([messages.PistonSample(i * 1e-3, 0.0)]) for i in range(16)]
    for index in kept:
        decoder.decode(stream[index])
    counts = decoder.counts()
    assert counts.ok + counts.repeated + counts.reordered == len(kept)
