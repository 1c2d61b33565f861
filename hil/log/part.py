"""One MCAP file of a log: its topics, and its chunks as numpy blocks."""

from __future__ import annotations

import struct
from collections import namedtuple
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from hil.errors import LogError
from hil.log import chunks, summary
from hil.log.records import PAYLOAD_OFFSET, Field, Layout, parse_definition
from hil.log.summary import ChunkPlace

BROKEN = (
    McapError,
    ValueError,
    KeyError,
    OSError,
    RuntimeError,
    struct.error,
    zstandard.ZstdError,
)

_named_tuple: Any = namedtuple  # the fields come from the file, no type checker can know them


class TopicInfo(NamedTuple):
    """A topic of a log: its fields with types and units, and how many messages it has."""

    name: str
    fields: tuple[Field, ...]
    messages: int
    channel_id: int
    layout: Layout


class Attachment(NamedTuple):
    """A file that a log carries."""

    name: str
    media_type: str
    content: bytes


class Span(NamedTuple):
    """A stretch of log time, both ends included [ns]."""

    start_ns: int = 0
    end_ns: int = 1 << 63

    def meets(self, place: ChunkPlace) -> bool:
        """Whether a chunk may have messages in it."""
        return place.start_ns <= self.end_ns and place.end_ns >= self.start_ns


ALWAYS = Span()


class Part:
    """An open file. Its methods raise LogError, naming the file, when the bytes are damaged."""

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self.path = path
        self.file = file
        try:
            found = summary.read_summary(file)
            self.topics = _topics(found)
            self.metadata = dict(summary.read_metadata(file, i) for i in found.metadata)
            self.attachments = {
                index.name: Attachment(*summary.read_attachment(file, index))
                for index in found.attachments
            }
        except BROKEN as error:
            raise self.error(f"no complete MCAP log: {why(error)}") from None
        self._chunk_records = found.chunk_records
        self.start_ns: int = found.statistics.message_start_time
        self.end_ns: int = found.statistics.message_end_time
        self.messages: int = found.statistics.message_count
        self.chunk_count: int = found.statistics.chunk_count

    @cached_property
    def places(self) -> tuple[ChunkPlace, ...]:
        """Where the chunks lie, in the order of the file."""
        try:
            return tuple(summary.chunk_place(body) for body in self._chunk_records)
        except BROKEN as error:
            raise self.error(f"no complete MCAP log: {why(error)}") from None

    def blocks(self, topic: str, span: Span) -> Iterator[NDArray[Any]]:
        """Yield the messages of a fixed-size topic as one structured array per chunk."""
        info = self.topics[topic]
        dtype = np.dtype(info.layout.numpy_spec)
        for data, offsets, sizes in self._chunks(info, span):
            if (sizes != dtype.itemsize).any():
                raise self.error(f"{topic} has messages that are not {dtype.itemsize} bytes long")
            block = chunks.gather(data, offsets, PAYLOAD_OFFSET, dtype)
            yield block if span is ALWAYS else _within(block, span)

    def records(self, topic: str, span: Span) -> Iterator[Any]:
        """Yield the messages of any topic as named tuples, in the order of the file."""
        info = self.topics[topic]
        record = _named_tuple("Record", [field.name for field in info.fields])
        for data, offsets, sizes in self._chunks(info, span):
            starts = offsets + PAYLOAD_OFFSET
            for start, end in zip(starts.tolist(), (starts + sizes).tolist(), strict=True):
                try:
                    values = record._make(info.layout.unpack(data[start:end]))
                except ValueError as error:
                    raise self.error(f"{topic}: {error}") from None
                if span is ALWAYS or span.start_ns <= values.t_ns <= span.end_ns:
                    yield values

    def raw(self, span: Span) -> Iterator[bytes]:
        """Yield the records of each chunk as they lie in the file."""
        for place in self.places:
            if span.meets(place):
                yield self._guarded(place, lambda at: chunks.chunk_bytes(self.file, at))

    def _chunks(
        self, info: TopicInfo, span: Span
    ) -> Iterator[tuple[bytes, NDArray[Any], NDArray[Any]]]:
        """Yield records, offsets and payload sizes of each chunk that has the topic."""
        for place in self.places:
            if info.channel_id in place.indexes and span.meets(place):
                yield self._guarded(place, lambda at: self._read_chunk(at, info.channel_id))

    def _guarded(self, place: ChunkPlace, read: Any) -> Any:  # noqa: ANN401
        """Read a chunk; damage is told with its place."""
        try:
            return read(place)
        except BROKEN as error:
            raise self.error(f"damaged chunk at byte {place.offset}: {why(error)}") from None

    def _read_chunk(
        self, place: ChunkPlace, channel: int
    ) -> tuple[bytes, NDArray[np.int64], NDArray[np.int64]]:
        data = chunks.chunk_bytes(self.file, place)
        offsets = chunks.message_offsets(self.file, place, channel)
        return data, offsets, chunks.check_heads(data, offsets, channel)

    def error(self, text: str) -> LogError:
        """Return the error that names this file."""
        return LogError(f"{self.path}: {text}")


def open_part(path: Path) -> Part:
    """Open one finished file.

    Raises: LogError when the file cannot be read or is no complete log
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None
    try:
        return Part(path, file)
    except LogError:
        file.close()
        raise


def why(error: BaseException) -> str:
    """Return what an exception says, or its name when it says nothing."""
    return str(error) or type(error).__name__


def _within(block: NDArray[Any], span: Span) -> NDArray[Any]:
    t_ns = block["t_ns"]
    inside: NDArray[Any] = block[(t_ns >= span.start_ns) & (t_ns <= span.end_ns)]
    return inside


def _topics(found: summary.Summary) -> dict[str, TopicInfo]:
    counts = found.statistics.channel_message_counts
    topics = {}
    for number, channel in sorted(found.channels.items()):
        fields = _fields(channel, found.schemas.get(channel.schema_id))
        count = counts.get(number, 0)
        topics[channel.topic] = TopicInfo(channel.topic, fields, count, number, Layout(fields))
    return topics


def _fields(channel: Channel, schema: Schema | None) -> tuple[Field, ...]:
    if schema is None or (channel.message_encoding, schema.encoding) != ("cdr", "ros2msg"):
        raise ValueError(f"{channel.topic} is not cdr with a ros2msg schema")
    try:
        return parse_definition(schema.data.decode())
    except ValueError as error:
        raise ValueError(f"{channel.topic} has a schema of another kind: {error}") from None
