"""What the bytes of a topic's messages mean, as far as it can be known: by fields, or not at all.

Messages of scalars and fixed arrays are numpy rows; strings and byte sequences may follow them.
What is variable otherwise is decoded by mcap-ros2-support, an extra. Every other topic can be
counted, checked and copied, but not read: its coding carries the reason.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

from mcap.records import Channel, Schema

from hil.errors import LogError, install_command
from hil.log.definitions import parse_definition
from hil.log.records import CDR_LE, Field, Layout

_LARGEST_ROW = 1 << 24
_NOTHING = Layout(())


class UndecodableError(LogError):
    """The messages of a topic cannot be read; the others of the log can."""


class Coding(NamedTuple):
    """Fields of a topic, and how its messages are decoded; a reason where they are not.

    `layout` says where the fields of fixed size lie; `fixed`: there are no others;
    `unpack` gives the values of one message with its encapsulation.
    """

    fields: tuple[Field, ...]
    layout: Layout
    fixed: bool
    unpack: Callable[[bytes], tuple[Any, ...]] | None
    reason: str = ""


def of_layout(layout: Layout) -> Coding:
    """Return the coding of records that a layout describes."""

    def unpack(message: bytes) -> tuple[Any, ...]:
        if message[:2] != CDR_LE[:2]:
            raise ValueError("it is not little-endian CDR")
        return layout.unpack(message[len(CDR_LE) :])

    return Coding(layout.fields, layout, not layout.variable, unpack)


def of_channel(channel: Channel, schema: Schema | None) -> Coding:
    """Return the coding of the messages of a channel, of whatever kind they are."""
    if channel.message_encoding != "cdr" or schema is None or schema.encoding != "ros2msg":
        kind = schema.encoding if schema else "no"
        encoding = channel.message_encoding or "nameless"
        return undecoded(f"{encoding} messages with {kind or 'no'} schema are not decoded")
    try:
        text = schema.data.decode("utf-8-sig")
        fields = parse_definition(text, schema.name.partition("/")[0])
    except ValueError as error:
        return undecoded(f"its schema is of another kind: {error}")
    layout = _layout(fields)
    if layout is not None and layout.size > _LARGEST_ROW:
        return undecoded(f"a message would have {layout.size} bytes")
    return of_layout(layout) if layout is not None else _through_library(schema, text, fields)


def undecoded(reason: str) -> Coding:
    """Return the coding of messages that can be counted and copied, but not read."""
    return Coding((), _NOTHING, fixed=False, unpack=None, reason=reason)


def _layout(fields: tuple[Field, ...]) -> Layout | None:
    """Return the layout of fields of fixed size with variable ones behind, if they are such."""
    try:
        return Layout(fields)
    except (ValueError, struct.error, OverflowError):
        return None


def _through_library(schema: Schema, text: str, fields: tuple[Field, ...]) -> Coding:
    try:
        from mcap_ros2.decoder import DecoderFactory  # noqa: PLC0415  # an extra
    except ImportError:
        return undecoded(f"needs mcap-ros2-support: {install_command('export')}")
    plain = Schema(schema.id, text.encode(), schema.encoding, schema.name)
    try:
        decode = DecoderFactory().decoder_for("cdr", plain)
    except Exception as error:  # a parser of others, fed with whatever a file holds
        return undecoded(f"its schema is of another kind: {error}")
    unpack = partial(_values, decode, fields)
    return Coding(fields, _NOTHING, fixed=False, unpack=unpack)


def _values(decode: Any, fields: tuple[Field, ...], message: bytes) -> tuple[Any, ...]:  # noqa: ANN401
    """Decode one message and take its fields apart.

    Raises: ValueError with what the decoder says
    """
    try:
        found = decode(message)
        return tuple(_plain(attrgetter(field.name)(found), field.type) for field in fields)
    except Exception as error:  # as above
        raise ValueError(f"not decoded: {str(error) or type(error).__name__}") from None


def _plain(value: Any, kind: str) -> Any:  # noqa: ANN401
    """Return a value as a scalar, a string, bytes, or a list; messages in an array as JSON."""
    if kind in {"uint8[]", "int8[]"}:
        return bytes(value) if kind == "uint8[]" else list(value)
    if kind.endswith("]"):
        items = list(value)
        return json.dumps(items, default=_object) if "/" in kind else items
    return value


def _object(value: Any) -> Any:  # noqa: ANN401
    """Return a decoded message or array as JSON has it."""
    names = getattr(type(value), "__slots__", None)
    if names is None:
        return list(value)
    return {name: getattr(value, name) for name in names}
