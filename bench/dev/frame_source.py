"""hil/wire/frames: each message's packing as straight code, from the declarations."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import Final

from hil.wire import messages
from hil.wire.fields import LAYOUTS, Layout, Placed

_SENDERS: Final = tuple(dict.fromkeys(layout.sender for layout in LAYOUTS.values()))
_WORD_BITS: Final = 64
_HEAD: Final = '''"""Frames of the {sender}, as straight code.

Generated from `{source}.py` by `python -m bench.dev.generate`; do not edit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

from mypy_extensions import i64

from hil.wire.e2e import counter_marks, crc8
from hil.wire.fields import LAYOUTS
from {module} import {names}
from hil.wire.stream import ROUND, Stream, refuse

_NAN: Final = float("nan")
'''
_STREAM: Final = '''

_{constant}_MARKS: Final = counter_marks(LAYOUTS[{can_id:#x}].data_ids)


@final
class {name}Stream(Stream[{name}]):
    """{name} on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__({can_id:#x}, _{constant}_MARKS)

    def pack(self, message: {name}) -> i64:
        """Return the bare word of a message."""
{pack}

    def unpack(self, word: i64) -> {name} | None:
        """Return the message of a bare word, None when a value is out of range."""
{unpack}
'''


def modules() -> dict[str, partial[str]]:
    """Return what makes the text of each module, by its path from the root."""
    return {f"hil/wire/frames/{sender}.py": partial(text, sender) for sender in _SENDERS}


def text(sender: str) -> str:
    """Return the module of one sender's messages."""
    layouts = [layout for layout in LAYOUTS.values() if layout.sender == sender]
    module = messages.__name__
    head = _HEAD.format(
        sender=sender, source=module.replace(".", "/"), module=module,
        names=", ".join(sorted(layout.name for layout in layouts)),
    )  # fmt: skip
    kinds = [f"    {layout.name}: {layout.name}Stream,\n" for layout in layouts]
    table = (
        "\n\nSTREAMS: Final[dict[type, Callable[[], Stream[Any]]]] = {\n" + "".join(kinds) + "}\n"
    )
    return head + "".join(map(_stream, layouts)) + table


def _stream(layout: Layout) -> str:
    """The class of one message."""
    lines = {"pack": _pack(layout), "unpack": _unpack(layout)}
    constant = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", layout.name).upper()
    bodies = {name: "\n".join(" " * 8 + line for line in body) for name, body in lines.items()}
    return _STREAM.format(name=layout.name, can_id=layout.can_id, constant=constant, **bodies)


def _pack(layout: Layout) -> Iterator[str]:
    """Lines of `pack`: each value in range, rounded, at its place; then the CRC of them all."""
    yield "word: i64 = 0"
    for placed in layout.fields:
        name, signal = placed.name, placed.signal
        low, high = map(float if placed.is_float else int, signal.raw_range)
        value = f"message.{name}"
        if placed.is_float:
            value = f"({value} / {float(signal.scale)!r} + ROUND) - ROUND"
        lines = [
            f"{name} = {value}",
            f"if not {low!r} <= {name} <= {high!r}:",
            f'    refuse(message, "{name}")',
            f"word |= {_placed(placed)} << {placed.start_bit}",
        ]
        yield from _when(layout, placed, lines)
    yield "return word | crc8(word)"


def _placed(placed: Placed) -> str:
    """A raw value within its range as the bits of its field; bit 63 is the sign of the word."""
    bits = placed.signal.bits
    raw = f"int({placed.name})" if placed.is_float else placed.name
    if placed.start_bit + bits == _WORD_BITS:
        return raw if placed.signal.signed else f"(({raw} ^ {_half(bits)}) - {_half(bits)})"
    return f"({raw} & {(1 << bits) - 1})" if placed.signal.signed else raw


def _half(bits: int) -> int:
    return 1 << bits - 1


def _unpack(layout: Layout) -> Iterator[str]:
    """Lines of `unpack`: the raw value of each field, its range, its scale."""
    for placed in layout.fields:
        name, signal = placed.name, placed.signal
        raw = f"word >> {placed.start_bit} & {(1 << signal.bits) - 1}"
        if signal.signed:
            raw = f"({raw} ^ {_half(signal.bits)}) - {_half(signal.bits)}"
        low, high = signal.raw_range
        lines = [f"raw = {raw}"]
        if (low, high) != _width(placed):
            lines += [f"if not {low} <= raw <= {high}:", "    return None"]
        value = f"float(raw) * {float(signal.scale)!r}" if placed.is_float else "raw"
        if signal.only_when is not None:
            yield f"{name} = _NAN"
        yield from _when(layout, placed, [*lines, f"{name} = {value}"])
    yield f"return {layout.name}({', '.join(placed.name for placed in layout.fields)})"


def _width(placed: Placed) -> tuple[int, int]:
    """Smallest and largest raw value that the field's bits can hold."""
    half = _half(placed.signal.bits)
    return (-half, half - 1) if placed.signal.signed else (0, 2 * half - 1)


def _when(layout: Layout, placed: Placed, lines: list[str]) -> list[str]:
    """Let the lines of a field under a selector be run only while it is selected."""
    if placed.signal.only_when is None:
        return lines
    selector = next(p.name for p in layout.fields if p.signal.selects)
    return [f"if {selector} == {placed.signal.only_when}:", *("    " + line for line in lines)]
