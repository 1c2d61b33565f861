"""Log records, declared once: byte layout, ROS 2 definition and packing follow from the fields.

A record is a class whose annotations carry a `Field` each. Its bytes in the log are CDR, which
for fixed-size fields is a little-endian C struct with natural alignment, behind the head of an MCAP
Message record. What is packed in every tick has generated functions: hil/log/packing.py.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, get_type_hints

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of an MCAP file
LIBRARY = "fpeg-hil log "  # in the header of our files, before the version of the format
FORMAT = 1  # goes up when a reader of the version before would misunderstand the topics
CDR_LE = b"\x00\x01\x00\x00"  # encapsulation: plain CDR, little endian
MESSAGE = 0x05  # opcode of an MCAP Message record
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log, publish time
PAYLOAD_OFFSET = MESSAGE_HEAD.size + len(CDR_LE)

EVERY_TICK, EVERY_STROKE, NOW_AND_THEN = "tick", "stroke", "occasion"
BOTH_SIDES = ("plant", "controller")

# ROS 2 type: struct code, size in bytes (which is also its alignment)
SCALARS = {
    "bool": ("?", 1),
    "uint8": ("B", 1),
    "int8": ("b", 1),
    "uint16": ("H", 2),
    "int16": ("h", 2),
    "uint32": ("I", 4),
    "int32": ("i", 4),
    "uint64": ("Q", 8),
    "int64": ("q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
_VARIABLE = ("string", "uint8[]")
_ARRAY = re.compile(r"(\w+)\[(\d+)\]")


class Field(NamedTuple):
    """One field of a record: ROS 2 type, meaning, unit; the name comes from the annotation."""

    type: str
    text: str
    unit: str = ""
    name: str = ""


class Record:
    """Base of the record declarations; they are read, never instantiated."""


def fields_of(record: type[Record]) -> tuple[Field, ...]:
    """Return the declared fields of a record class, in order.

    Raises: TypeError when a field carries no `Field`
    """
    hints = get_type_hints(record, include_extras=True)
    fields = []
    for name, hint in hints.items():
        found = [m for m in getattr(hint, "__metadata__", ()) if isinstance(m, Field)]
        if len(found) != 1:
            raise TypeError(f"{record.__name__}.{name}: exactly one Field(...) is needed")
        fields.append(found[0]._replace(name=name))
    return tuple(fields)


def definition(fields: tuple[Field, ...], text: str) -> str:
    """Return the ROS 2 message definition of the fields; units stand in brackets."""
    lines = [f"# {line.strip()}".rstrip() for line in text.strip().splitlines()]
    for field in fields:
        unit = f"[{field.unit}] " if field.unit else ""
        lines.append(f"{field.type} {field.name}  # {unit}{field.text}")
    return "\n".join(lines) + "\n"


def scalar_of(kind: str) -> tuple[str, int, int | None]:
    """Return struct code, size and array length (None: a scalar) of a fixed-size type."""
    array = _ARRAY.fullmatch(kind)
    base, count = (array[1], int(array[2])) if array else (kind, None)
    if base not in SCALARS:
        accepted = ", ".join([*SCALARS, *_VARIABLE])
        raise ValueError(f"type {kind!r}: accepted are {accepted} and fixed arrays like uint8[4]")
    code, size = SCALARS[base]
    return code, size, count


class Layout:
    """Where the fields of a record lie in its CDR payload (behind the 4 encapsulation bytes).

    `size` counts the fixed-size fields, which come first; `format` is their struct format;
    `numpy_spec` is what `numpy.dtype` takes; `variable` are the fields of variable size.
    """

    def __init__(self, fields: tuple[Field, ...]) -> None:
        self.fields = fields
        fixed = [field for field in fields if field.type not in _VARIABLE]
        self.variable = fields[len(fixed) :]
        if any(field.type not in _VARIABLE for field in self.variable):
            raise ValueError("fields of variable size come last")
        self._fixed = tuple((field.name, *scalar_of(field.type)) for field in fixed)
        self.format, self.size, offsets = _align(self._fixed)
        self._lead = struct.Struct(self.format)
        self.numpy_spec: Any = {
            "names": [name for name, *_ in self._fixed],
            "formats": [
                f"<{code}{size}" if n is None else (f"<{code}{size}", (n,))
                for name, code, size, n in _numpy_codes(self._fixed)
            ],
            "offsets": offsets,
            "itemsize": self.size,
        }

    def unpack(self, payload: bytes) -> tuple[Any, ...]:
        """Return the values of one payload, fixed arrays as tuples.

        Raises: ValueError when the payload is shorter than its fields
        """
        if len(payload) < self.size:
            raise ValueError(f"payload has {len(payload)} bytes, its fields need {self.size}")
        flat = iter(self._lead.unpack_from(payload))
        values = [
            next(flat) if count is None else tuple(next(flat) for _ in range(count))
            for _, _, _, count in self._fixed
        ]
        return (*values, *self._tail(payload))

    def _tail(self, payload: bytes) -> Iterator[Any]:
        offset = self.size
        for field in self.variable:
            offset += -offset % 4
            start = offset + 4
            length = int.from_bytes(payload[offset:start], "little")
            offset = start + length
            if len(payload) < offset:
                raise ValueError(f"payload has {len(payload)} bytes, {field.name} ends at {offset}")
            raw = bytes(payload[start:offset])
            yield _string(raw) if field.type == "string" else raw


def _string(raw: bytes) -> str:
    """Text of a string; bytes of others that are no UTF-8 are told by their numbers."""
    return raw.removesuffix(b"\0").decode(errors="backslashreplace")


_Fixed = tuple[tuple[str, str, int, int | None], ...]


def _align(fixed: _Fixed) -> tuple[str, int, list[int]]:
    """Return struct format, size and offsets with every field at a multiple of its size."""
    parts, offsets, offset = ["<"], [], 0
    for _, code, size, count in fixed:
        pad = -offset % size
        parts.append("x" * pad + (code if count is None else f"{count}{code}"))
        offsets.append(offset + pad)
        offset += pad + size * (1 if count is None else count)
    return "".join(parts), offset, offsets


def _numpy_codes(fixed: _Fixed) -> Iterator[tuple[str, str, int, int | None]]:
    for name, code, size, count in fixed:
        kind = "b" if code == "?" else "f" if code in "fd" else "u" if code.isupper() else "i"
        yield name, kind, size, count


def _pack_tail(values: Iterable[str | bytes]) -> bytes:
    """Return strings and byte sequences as CDR that starts at a multiple of 4."""
    out = bytearray()
    for value in values:
        raw = value if isinstance(value, bytes) else value.encode() + b"\0"
        out += bytes(-len(out) % 4) + len(raw).to_bytes(4, "little") + raw
    return bytes(out)


class Topic:
    """A record class under a name and a channel number of the log.

    `layout`, `definition` and `schema_name` describe it; hil/log/packing.py has a function of its
    own for what is packed in every tick.
    length: what the length field of a record counts, without strings and byte sequences
    rate: how often it is put, in a word: every tick, every stroke, now and then
    sides: the processes that put it

    Raises: ValueError when `tick` or `t_ns` is missing
    """

    def __init__(
        self, name: str, channel_id: int, record: type[Record], rate: str = NOW_AND_THEN,
        sides: tuple[str, ...] = BOTH_SIDES,
    ) -> None:  # fmt: skip
        fields = fields_of(record)
        self.name = name
        self.channel_id = channel_id
        self.record = record
        self.rate = rate
        self.sides = sides
        self.layout = layout = Layout(fields)
        self.schema_name = f"fpeg_hil/msg/{record.__name__}"
        self.definition = definition(fields, record.__doc__ or "")
        self._names = [field.name for field in fields]
        if not {"tick", "t_ns"} <= set(self._names):
            raise ValueError("a log record needs the fields tick and t_ns")
        self._tick_at, self._t_ns_at = self._names.index("tick"), self._names.index("t_ns")
        pad = -layout.size % 4 if layout.variable else 0
        self.length = PAYLOAD_OFFSET - 9 + layout.size + pad
        self.payload_format = f"{layout.format[1:]}{'x' * pad}"
        self._into_one = struct.Struct(f"{MESSAGE_HEAD.format}4s{self.payload_format}").pack

    def pack(self, *values: Any, **named: Any) -> bytes:  # noqa: ANN401
        """Return a record as a complete MCAP Message record, from its fields in turn or by name.

        log_time = publish_time = t_ns and sequence = tick.

        Raises: struct.error for a value outside its type, TypeError for a field too few or too many
        """
        if named:
            values = (*values, *[named.pop(name) for name in self._names[len(values) :]])
        if named or len(values) != len(self._names):
            raise TypeError(f"{self.name} has the fields {', '.join(self._names)}")
        tick, t_ns = values[self._tick_at], values[self._t_ns_at]
        cut = len(values) - len(self.layout.variable)
        numbers: list[Any] = []
        for value in values[:cut]:
            numbers += value if isinstance(value, tuple) else (value,)
        tail = _pack_tail(values[cut:])
        return self._into_one(
            MESSAGE, self.length + len(tail), self.channel_id, tick, t_ns, t_ns, CDR_LE, *numbers
        ) + tail  # fmt: skip
