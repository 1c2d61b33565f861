"""Declaring messages: what fits, what is refused, and what the docstring becomes."""

from typing import Annotated as A
from typing import NamedTuple

import pytest

from hil.wire.fields import (
    LAYOUTS,
    PAYLOAD_BITS,
    PAYLOAD_START_BIT,
    Signal,
    layout_of,
    message,
)
from hil.wire.messages import MachineCommand, PistonSample, PlantTick


def declare(cls, can_id=0x7F0):
    return message(can_id, sender="plant", receiver="controller")(cls)


def test_signals_follow_each_other_from_the_first_bit_after_the_counter():
    begins = [placed.start_bit - PAYLOAD_START_BIT for placed in layout_of(PistonSample).fields]
    assert begins == [0, 24, 48]


def test_signals_under_a_selector_share_one_place():
    shared = [p for p in layout_of(PlantTick).fields if p.signal.only_when is not None]
    assert len(shared) == 4
    assert len({placed.start_bit for placed in shared}) == 1


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)
def test_no_two_signals_that_travel_together_share_a_bit(layout):
    selections = {placed.signal.only_when for placed in layout.fields}
    for selection in selections:
        bits = [
            bit
            for placed in layout.fields
            if placed.signal.only_when in (None, selection)
            for bit in range(placed.start_bit, placed.start_bit + placed.signal.bits)
        ]
        assert len(bits) == len(set(bits))
        assert min(bits) >= PAYLOAD_START_BIT
        assert max(bits) < 64


def test_too_many_bits_are_refused_with_their_number():
    class Wide(NamedTuple):
        first: A[int, Signal("u32")]
        second: A[int, Signal("u21")]

    with pytest.raises(ValueError, match=f"Wide needs 53 bits of {PAYLOAD_BITS}"):
        declare(Wide)
    assert 0x7F0 not in LAYOUTS


def test_can_id_that_is_taken_is_refused_with_its_owner():
    class Second(NamedTuple):
        x: A[int, Signal("u8")]

    with pytest.raises(ValueError, match="Second: CAN id 0x101 is PistonSample's"):
        declare(Second, 0x101)
    assert LAYOUTS[0x101].make is PistonSample


def test_field_without_a_signal_is_refused_by_name():
    class Bare(NamedTuple):
        x: A[int, Signal("u8")]
        y: int

    with pytest.raises(TypeError, match=r"Bare\.y has no Signal"):
        declare(Bare)
    assert 0x7F0 not in LAYOUTS


@pytest.mark.parametrize(
    ("signal", "raw_range"),
    [
        (Signal("u8"), (0, 255)),
        (Signal("i8"), (-128, 127)),
        (Signal("i24", scale=1e-8, minimum=-0.08, maximum=0.08), (-8_000_000, 8_000_000)),
        (Signal("u8", scale=0.004, minimum=0.0, maximum=1.0), (0, 250)),
        (Signal("u4", maximum=100), (0, 15)),
        (Signal("u3", minimum=1), (1, 7)),
    ],
)
def test_range_is_that_of_the_width_narrowed_by_the_limits(signal, raw_range):
    assert signal.raw_range == raw_range


@pytest.mark.parametrize("counter", range(16))
def test_data_identifiers_tell_the_messages_apart(counter):
    assert len({layout.data_ids[counter] for layout in LAYOUTS.values()}) == len(LAYOUTS)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)
def test_every_message_and_every_field_says_what_it_means(layout):
    assert layout.comment
    assert set(layout.field_comments) == {placed.name for placed in layout.fields}
    assert all(layout.field_comments.values())


def test_docstring_lines_become_the_comments_of_their_fields():
    layout = layout_of(MachineCommand)
    assert layout.comment == "What the linear machine is to do from the next tick on."
    assert layout.field_comments["force_n"].endswith("0 unless motoring")
