"""hil/wire/frames: each message's packing as straight code, from the declarations."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache, partial
from typing import Final

from hil import compiled
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

from hil.rounding import SHIFT
from hil.wire.e2e import BYTE_7, PAIR_1_2, PAIR_3_4, PAIR_5_6, counter_marks
from hil.wire.fields import LAYOUTS
from {module} import {names}
from hil.wire.stream import Stream, refuse

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

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
{take}
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
    lines = {"pack": _pack(layout), "take": _take(layout)}
    constant = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", layout.name).upper()
    bodies = {name: "\n".join(" " * 8 + line for line in body) for name, body in lines.items()}
    return _STREAM.format(name=layout.name, can_id=layout.can_id, constant=constant, **bodies)


def _pack(layout: Layout) -> Iterator[str]:
    """Lines of `pack`: each value in range, rounded, at its place; then the CRC of them all."""
    yield "word: i64 = 0"
    if any(placed.is_float for placed in layout.fields):
        yield "raw: i64"
    for placed in layout.fields:
        name, signal = placed.name, placed.signal
        low, high = map(float if placed.is_float else int, signal.raw_range)
        value = f"message.{name}"
        if placed.is_float:
            value = f"({value} / {float(signal.scale)!r} + SHIFT) - SHIFT"
        lines = [
            f"{name} = {value}",
            f"if not {low!r} <= {name} <= {high!r}:",
            f'    refuse(message, "{name}")',
        ]
        if placed.is_float:
            lines.append(f"raw = int({name})")
        lines.append(f"word |= {_placed(placed)} << {placed.start_bit}")
        yield from _when(layout, placed, lines)
    yield f"return word | {_crc()}"


@cache
def _crc() -> str:
    """The expression of `crc8`: in its place it costs no call, which the interpreter would feel."""
    tree = ast.parse((compiled.root() / "hil/wire/e2e.py").read_text(encoding="utf-8"))
    found = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == "crc8")
    result = next(n.value for n in found.body if isinstance(n, ast.Return) and n.value)
    return ast.unparse(result)


def _placed(placed: Placed) -> str:
    """A raw value within its range as the bits of its field; bit 63 is the sign of the word."""
    bits = placed.signal.bits
    raw = "raw" if placed.is_float else placed.name
    if placed.start_bit + bits == _WORD_BITS:
        return raw if placed.signal.signed else f"(({raw} ^ {_half(bits)}) - {_half(bits)})"
    return f"({raw} & {(1 << bits) - 1})" if placed.signal.signed else raw


def _half(bits: int) -> int:
    return 1 << bits - 1


def _take(layout: Layout) -> Iterator[str]:
    """Lines of `take`: the CRC, then the raw value of each field, its range, its scale."""
    yield from (f"if ({_crc()}) != word & 0xFFF:", "    return False")
    yield from ("self.counter, self.bare, self.message = counter, word, None",)
    for placed in layout.fields:
        name, signal = placed.name, placed.signal
        raw = f"{name}_raw" if placed.is_float else name
        value = f"word >> {placed.start_bit} & {(1 << signal.bits) - 1}"
        if signal.signed:
            value = f"({value} ^ {_half(signal.bits)}) - {_half(signal.bits)}"
        low, high = signal.raw_range
        lines = [f"{raw}: int = {value}" if placed.is_float else f"{raw} = {value}"]
        if (low, high) != _width(placed):
            lines += [f"if not {low} <= {raw} <= {high}:", "    return True"]
        if placed.is_float:
            lines.append(f"{name} = {raw} * {float(signal.scale)!r}")
        if signal.only_when is not None:
            yield f"{name} = _NAN"
        yield from _when(layout, placed, lines)
    values = ", ".join(placed.name for placed in layout.fields)
    yield from (f"self.message = {layout.name}({values})", "return True")


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
