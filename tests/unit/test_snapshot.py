"""Snapshots: a state comes back as the very same bits, and nothing else comes back."""

import math
import struct
import sys
from enum import IntEnum
from typing import Any, NamedTuple, final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil import snapshot
from hil.errors import LogError
from hil.values import Value, fields_of

FLOATS = st.floats(allow_nan=True, allow_infinity=True)


class Mode(IntEnum):
    OFF = 0
    ON = 3


class Inner(NamedTuple):
    x_m: float
    count: int = 0


@final
class Other(Value):
    __slots__ = ("text", "inner")

    def __init__(self, text: str, inner: Inner | None = None) -> None:
        self.text = text
        self.inner = inner


class Whole(NamedTuple):
    mode: Mode
    inner: Inner
    either: Inner | Other
    maybe: Inner | None
    many: tuple[Inner, ...]
    pair: tuple[float, int]
    held: tuple[tuple[int, Inner], ...]
    data: bytes
    some: Any
    flag: bool
    name: str | None


INNER = st.builds(Inner, FLOATS, st.integers(-(2**70), 2**70))
WHOLE = st.builds(
    Whole,
    st.sampled_from(Mode),
    INNER,
    st.one_of(INNER, st.builds(Other, st.text(), st.none() | INNER)),
    st.none() | INNER,
    st.lists(INNER).map(tuple),
    st.tuples(FLOATS, st.integers()),
    st.lists(st.tuples(st.integers(), INNER)).map(tuple),
    st.binary(max_size=30),
    st.one_of(st.none(), FLOATS, INNER, st.sampled_from(Mode)),
    st.booleans(),
    st.none() | st.text(),
)


def bits(value):
    """The value with every float as its 64 bits, and every class by name."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("<d", value)
    if isinstance(value, tuple):
        return (type(value).__name__, *map(bits, value))
    if isinstance(value, Value):
        return (type(value).__name__, *(bits(getattr(value, f)) for f in fields_of(type(value))))
    return (type(value).__name__, value)


@given(WHOLE)
def test_a_state_comes_back_bit_by_bit(state):
    assert bits(snapshot.loads(Whole, snapshot.dumps(state))) == bits(state)


def test_a_kind_without_exact_text_is_refused_where_it_is_written():
    class Bad(NamedTuple):
        items: list[int]

    with pytest.raises(TypeError, match="has no exact text"):
        snapshot.dumps(Bad([1]))


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "[1,2,3]", "null", "7", '[0.5,0,"more"]', '{"a":1,"b":2}'],
)
def test_a_text_of_another_kind_is_told_in_one_line(text):
    with pytest.raises(LogError, match=r"no .*Inner.* of today"):
        snapshot.loads(Inner, text)


@pytest.mark.parametrize(
    "name", ["os:system", "builtins:eval", "nowhere:Inner", "os", "json:loads"]
)
def test_a_text_cannot_name_anything_but_a_state(name):
    class Holder(NamedTuple):
        some: Any

    with pytest.raises(LogError, match="is no state of today"):
        snapshot.loads(Holder, f'[{{"{name}":["true"]}}]')
    assert "nowhere" not in sys.modules
