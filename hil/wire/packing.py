"""Each message as straight code, `pack` and `unpack`: the only place where a scale is applied."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from hil.errors import CodecError
from hil.wire import messages as _messages
from hil.wire.e2e import CRC_SOURCE, CRC_TABLES
from hil.wire.fields import Layout, Placed, layout_of

DAMAGED: Final = object()
"""What `unpack` returns for a word whose CRC is wrong."""

_NAN: Final = float("nan")


def _pack_source(layout: Layout) -> list[str]:
    """Source of `pack(msg) -> bare`: range-checked raw values, each at its place, and their CRC."""
    names = ", ".join(placed.name for placed in layout.fields)
    selector = next((p.name for p in layout.fields if p.signal.selects), "")
    source = ["def pack(msg):", f"    {names}, = msg"]
    for placed in layout.fields:
        signal, indent, raw = placed.signal, "    ", f"raw_{placed.name}"
        if signal.only_when is not None:
            source += [f"    {raw} = 0", f"    if {selector} == {signal.only_when}:"]
            indent = "        "
        value = f"round({placed.name} / {signal.scale!r})" if placed.is_float else placed.name
        low, high = signal.raw_range
        source += [
            f"{indent}{raw} = {value}",
            f"{indent}if not {low} <= {raw} <= {high}: fail({placed.name!r}, {placed.name})",
        ]
    source.append(f"    word = {' | '.join(_placed_source(placed) for placed in layout.fields)}")
    return [*source, f"    return word | {CRC_SOURCE}"]


def _placed_source(placed: Placed) -> str:
    """Source of a raw value within its range at its place; only a negative one needs a mask."""
    raw = f"raw_{placed.name}"
    if placed.signal.signed:
        raw = f"({raw} & {(1 << placed.signal.bits) - 1})"
    return f"{raw} << {placed.start_bit}"


def _unpack_source(layout: Layout) -> list[str]:
    """Source of `unpack(bare)`: the message, None for a value out of range, or DAMAGED."""
    selector = next((p.name for p in layout.fields if p.signal.selects), "")
    source = ["def unpack(word):", f"    if {CRC_SOURCE} != word & 0xFFF: return DAMAGED"]
    for placed in layout.fields:
        indent = "    "
        if placed.signal.only_when is not None:
            source += [
                f"    {placed.name} = NAN",
                f"    if {selector} == {placed.signal.only_when}:",
            ]
            indent = "        "
        source += [indent + line for line in _unpack_field(placed)]
    names = ", ".join(placed.name for placed in layout.fields)
    return [*source, f"    return new(cls, ({names},))"]


def _unpack_field(placed: Placed) -> list[str]:
    """Source lines that put one field's value into a variable of its name."""
    signal = placed.signal
    raw = f"word >> {placed.start_bit} & {(1 << signal.bits) - 1}"
    low, high = signal.raw_range
    width_low, width_high = 0, (1 << signal.bits) - 1
    if signal.signed:
        half = 1 << signal.bits - 1
        raw = f"({raw} ^ {half}) - {half}"
        width_low, width_high = -half, half - 1
    scale = f" * {signal.scale!r}" if placed.is_float else ""
    if (low, high) == (width_low, width_high):
        return [f"{placed.name} = {f'({raw}){scale}' if scale else raw}"]
    return [
        f"raw = {raw}",
        f"if not {low} <= raw <= {high}: return None",
        f"{placed.name} = raw{scale}",
    ]


def _refusal(layout: Layout, placed: Placed, value: object) -> str:
    """What is wrong with a value: message, signal, value (an integer as one) and range."""
    low, high = (raw * placed.signal.scale for raw in placed.signal.raw_range)
    accepted = f"accepted {low:.10g} to {high:.10g} {placed.signal.unit}".rstrip()
    return f"{layout.name}.{placed.name} = {value!r}: {accepted}"


def no_number(message: _messages.Message) -> str:
    """Name the signal that would be on the wire and is nan or infinite."""
    layout = layout_of(type(message))
    pairs = [(placed, float(v)) for placed, v in zip(layout.fields, message, strict=True)]
    selected = next((value for placed, value in pairs if placed.signal.selects), None)
    return next(
        _refusal(layout, placed, value)
        for placed, value in pairs
        if not math.isfinite(value) and placed.signal.only_when in {None, selected}
    )


def compile_layout(layout: Layout) -> tuple[Callable[[Any], int], Callable[[int], Any]]:
    """Turn a layout into two functions; a loop over signals would cost three times as much."""

    def fail(name: str, value: object) -> None:
        placed = next(p for p in layout.fields if p.name == name)
        raise CodecError(_refusal(layout, placed, value))

    scope: dict[str, Any] = {
        "fail": fail, "new": tuple.__new__, "cls": layout.make, "NAN": _NAN, "DAMAGED": DAMAGED,
        **CRC_TABLES,
    }  # fmt: skip
    source = "\n".join(_pack_source(layout) + _unpack_source(layout))
    exec(compile(source, f"<codec of {layout.name}>", "exec"), scope)
    return scope["pack"], scope["unpack"]
