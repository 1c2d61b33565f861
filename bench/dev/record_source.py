"""The source of hil/log/packing.py: the records that a tick may have, each with its own function.

Compiled, a record is native stores into one reused buffer; interpreted, one `struct.pack`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Final, NamedTuple

from hil.log.records import CDR_LE, MESSAGE, Field, Topic, scalar_of
from hil.log.topics import HOT

_NATIVE: Final = {"uint8": "i64", "uint32": "i64", "int64": "i64", "float64": "float"}
_HEAD: Final = '''\
"""Records of a tick, added one by one; written by `python -m bench.dev.generate`.

What they hold is declared in hil/log/topics.py. A number outside its type raises struct.error.
"""

# fmt: off
# ruff: noqa: E501
from __future__ import annotations

import struct
from typing import Final

from librt.strings import BytesWriter, write_f64_le, write_i32_le, write_i64_le
from mypy_extensions import i32, i64

_OUT: Final = BytesWriter()
_PARTS: Final[list[bytes]] = []
_add: Final = _PARTS.append


def begin() -> None:
    """Begin with no record."""
    if NATIVE:
        _OUT.truncate(0)
    else:
        _PARTS.clear()


def packed() -> bytes:
    """Return the records added since the beginning, one behind the other."""
    return _OUT.getvalue() if NATIVE else b"".join(_PARTS)


def _stamp(tick: i64, t_ns: i64) -> None:
    write_i32_le(_OUT, i32(tick))
    write_i64_le(_OUT, t_ns)
    write_i64_le(_OUT, t_ns)
    write_i32_le(_OUT, {cdr})


NATIVE: Final = not hasattr(_stamp, "__code__")
"""Whether this module is compiled: interpreted, a native store costs more than `struct` does."""
'''


class _Place(NamedTuple):
    """One number of a record: where it lies, and what is stored there."""

    offset: int
    size: int
    is_float: bool
    value: str


def text() -> str:
    """Return the source.

    Raises: ValueError for a field of a type that has no native store
    """
    head = _HEAD.replace("{cdr}", str(int.from_bytes(CDR_LE, "little")))
    return "\n\n".join([head, *(_record(topic) for topic in HOT)])


def _record(topic: Topic) -> str:
    """Struct and function of one record."""
    name = topic.name[1:].replace("/", "_")
    constant, has_data = f"_{name.upper()}", bool(topic.layout.variable)
    form = f"<{'BQH' if has_data else '11s'}IQQ4s{topic.payload_format}{'I' if has_data else ''}"
    arguments = [f"{field.name}: {_python_type(field)}" for field in topic.layout.fields]
    checks = " | ".join(check for field in topic.layout.fields for check in _checks(field))
    ending = ") + data)" if has_data else "))"
    parts = [
        f'{constant}: Final = struct.Struct("{form}").pack\n\n\n',
        _call(f"def {name}(", arguments, ") -> None:"),
        f'    """Add a record of {topic.name}."""\n',
        f"    if NATIVE and not ({checks}):\n",
        *(f"        {line}\n" for line in _stores(topic)),
        "    else:\n",
        _call(f"_add({constant}(", list(_values(topic)), ending, "        "),
    ]
    return "".join(parts)


def _call(head: str, arguments: list[str], tail: str, indent: str = "") -> str:
    """A definition or a call, on as many lines as it takes."""
    whole = f"{indent}{head}{', '.join(arguments)}{tail}"
    if len(whole) <= 100:
        return f"{whole}\n"
    inner, lines = f"{indent}    ", [""]
    for argument in arguments:
        if len(inner + lines[-1] + argument) > 98:
            lines.append("")
        lines[-1] += f"{argument}, "
    listed = "".join(f"{inner}{line.rstrip()}\n" for line in lines)
    return f"{indent}{head}\n{listed}{indent}{tail}\n"


def _python_type(field: Field) -> str:
    """The type of an argument; a fixed array is a tuple, which costs nothing compiled."""
    if field.type == "uint8[]":
        return "bytes"
    base, _, count = field.type.rstrip("]").partition("[")
    if base not in _NATIVE:
        raise ValueError(f"{field.name}: {field.type}: accepted are {', '.join(_NATIVE)}, uint8[]")
    return f"tuple[{', '.join([_NATIVE[base]] * int(count))}]" if count else _NATIVE[base]


def _checks(field: Field) -> Iterator[str]:
    """Expressions that are zero when the numbers of a field are within their type."""
    if field.name == "t_ns":
        yield "t_ns >> 63"
    elif field.type.startswith("uint") and field.type != "uint8[]":
        yield from (f"{value} >> {8 * size}" for _, size, _, value in _numbers(field, 0))


def _numbers(field: Field, offset: int) -> Iterator[_Place]:
    """The numbers of a field of fixed size."""
    code, size, count = scalar_of(field.type)
    for i in range(count or 1):
        value = field.name if count is None else f"{field.name}[{i}]"
        yield _Place(offset + i * size, size, code == "d", value)


def _stores(topic: Topic) -> Iterator[str]:
    """The native stores of one record."""
    channel = topic.channel_id.to_bytes(2, "little")
    if topic.layout.variable:
        yield "size = len(data)"
        yield f"_OUT.append({MESSAGE})"
        yield f"write_i64_le(_OUT, {topic.length + 4} + size)"
        yield f"_OUT.write({channel!r})"
    else:
        yield f"_OUT.write({_head_of(topic)!r})"
    yield "_stamp(tick, t_ns)"
    yield from _words(topic)
    if topic.layout.variable:
        yield "write_i32_le(_OUT, i32(size))"
        yield "_OUT.write(data)"


def _head_of(topic: Topic) -> bytes:
    """Opcode, length and channel of records that all have one size."""
    return struct.pack("<BQH", MESSAGE, topic.length, topic.channel_id)


def _words(topic: Topic) -> Iterator[str]:
    """Stores of eight bytes at a time; numbers that share them are shifted to their place."""
    words: dict[int, list[_Place]] = {}
    offsets = topic.layout.numpy_spec["offsets"]
    for field, offset in zip(topic.layout.fields, offsets, strict=False):
        for place in _numbers(field, offset):
            words.setdefault(place.offset // 8, []).append(place)
    end = struct.calcsize(f"<{topic.payload_format}")
    for index, places in words.items():
        word = " | ".join(_shifted(place, 8 * index) for place in places)
        left = end - 8 * index
        if places[0].is_float:
            yield f"write_f64_le(_OUT, {word})"
        elif left >= 8:
            yield f"write_i64_le(_OUT, {word})"
        elif left == 4:
            yield f"write_i32_le(_OUT, i32({word}))"
        else:
            yield from (f"_OUT.append({place.value})" for place in places)


def _shifted(place: _Place, start: int) -> str:
    by = 8 * (place.offset - start)
    return f"{place.value} << {by}" if by else place.value


def _values(topic: Topic) -> Iterator[str]:
    """What `struct.pack` takes."""
    if topic.layout.variable:
        yield from (str(MESSAGE), f"{topic.length + 4} + len(data)", str(topic.channel_id))
    else:
        yield repr(_head_of(topic))
    yield from ("tick", "t_ns", "t_ns", repr(CDR_LE))
    for field in topic.layout.fields:
        if field.type == "uint8[]":
            yield "len(data)"
        else:
            yield field.name if scalar_of(field.type)[2] is None else f"*{field.name}"
