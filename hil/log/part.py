"""One MCAP file of a log: its topics, and its chunks as numpy blocks."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.errors import LogError
from hil.files import open_regular
from hil.log import chunks, coding, data_section, summary
from hil.log.coding import Coding, UndecodableError
from hil.log.records import CDR_LE, MESSAGE_HEAD, PAYLOAD_OFFSET, Field, Layout
from hil.log.summary import BROKEN, ChunkPlace, why

_CDR = np.dtype("<u2")
_LITTLE_ENDIAN = int.from_bytes(CDR_LE[:2], "little")

_named_tuple: Any = namedtuple  # the fields come from the file, no type checker can know them


class TopicInfo(NamedTuple):
    """A topic of a log: how many messages it has, in which channels, and what they mean."""

    name: str
    messages: int
    channels: tuple[int, ...]
    coding: Coding

    @property
    def fields(self) -> tuple[Field, ...]:
        """Fields with types and units; none when its messages are not decoded."""
        return self.coding.fields

    @property
    def layout(self) -> Layout:
        """Where the fields of fixed size lie."""
        return self.coding.layout


class Attachment(NamedTuple):
    """A file that a log carries."""

    name: str
    media_type: str
    content: bytes


class Span(NamedTuple):
    """A stretch of log time, both ends included [ns]."""

    start_ns: int = 0
    end_ns: int = (1 << 64) - 1

    def meets(self, place: ChunkPlace) -> bool:
        """Whether a chunk may have messages in it."""
        return place.start_ns <= self.end_ns and place.end_ns >= self.start_ns


ALWAYS = Span()


class Messages(NamedTuple):
    """The messages of a topic in one chunk: where they lie in its records, and when they are.

    Parameters: sizes : bytes behind the heads, encapsulation included; times : log time [ns]
    """

    data: bytes
    offsets: NDArray[np.int64]
    sizes: NDArray[np.int64]
    times: NDArray[np.uint64]

    def within(self, span: Span) -> Messages:
        """Return those of a stretch of time."""
        if span is ALWAYS:
            return self
        inside = (self.times >= span.start_ns) & (self.times <= span.end_ns)
        return Messages(self.data, self.offsets[inside], self.sizes[inside], self.times[inside])

    def payloads(self) -> Iterator[tuple[int, bytes]]:
        """Yield log time and bytes of each."""
        starts = self.offsets + MESSAGE_HEAD.size
        ends = starts + self.sizes
        for t_ns, start, end in zip(
            self.times.tolist(), starts.tolist(), ends.tolist(), strict=True
        ):
            yield t_ns, self.data[start:end]


class Part:
    """An open file. Its methods raise LogError, naming the file, when the bytes are damaged."""

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self.path = path
        self.file = file
        self._walked: tuple[ChunkPlace, ...] | None = None
        try:
            found = summary.read_summary(file)
            if not found.is_index():
                found, self._walked = data_section.walked(file, found)
            self.topics = _topics(found)
            self.metadata = dict(summary.read_metadata(file, i) for i in found.metadata)
            self.attachments = {
                index.name: Attachment(*summary.read_attachment(file, index))
                for index in found.attachments
            }
        except BROKEN as error:
            raise self.error(f"no complete MCAP log: {why(error)}") from None
        told = found.statistics
        assert told is not None  # a walked file gets its own
        self._chunk_records = found.chunk_records
        self.format = summary.format_of(found.header.library)
        self.start_ns, self.end_ns = found.span()
        self.messages: int = told.message_count
        self.chunk_count: int = told.chunk_count

    @cached_property
    def places(self) -> tuple[ChunkPlace, ...]:
        """Where the chunks lie, in the order of the file."""
        if self._walked is not None:
            return self._walked
        try:
            return tuple(summary.chunk_place(body) for body in self._chunk_records)
        except BROKEN as error:
            raise self.error(f"no complete MCAP log: {why(error)}") from None

    def blocks(self, topic: str, span: Span) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Yield (log times, messages) of a fixed-size topic as structured arrays, by chunks."""
        info = self.topics[topic]
        dtype = np.dtype(info.layout.numpy_spec)
        for found in self._chunks(info, span):
            short = found.sizes < dtype.itemsize + len(CDR_LE)
            if short.any():
                size = int(found.sizes[short][0])
                raise self._undecodable(
                    topic, f"a message of {size} bytes, its fields need {dtype.itemsize + 4}"
                )
            kinds = chunks.gather(found.data, found.offsets, MESSAGE_HEAD.size, _CDR)
            if (kinds != _LITTLE_ENDIAN).any():
                raise self._undecodable(topic, "messages that are not little-endian CDR")
            rows = chunks.gather(found.data, found.offsets, PAYLOAD_OFFSET, dtype)
            yield found.times, rows

    def records(self, topic: str, span: Span) -> Iterator[tuple[int, Any]]:
        """Yield (log time, message as a named tuple) of any topic, in the order of the file."""
        info = self.topics[topic]
        unpack = info.coding.unpack
        if unpack is None:
            raise self._undecodable(topic, info.coding.reason)
        record = _named_tuple("Record", [field.name for field in info.fields], rename=True)
        for t_ns, payload in self.payloads(topic, span):
            try:
                values = record._make(unpack(payload))
            except ValueError as error:
                raise self._undecodable(topic, str(error)) from None
            yield t_ns, values

    def payloads(self, topic: str, span: Span) -> Iterator[tuple[int, bytes]]:
        """Yield (log time, bytes) of the messages of any topic, in the order of the file."""
        for found in self._chunks(self.topics[topic], span):
            yield from found.payloads()

    def raw(self, span: Span) -> Iterator[bytes]:
        """Yield the records of each chunk as they lie in the file."""
        for place in self.places:
            if span.meets(place):
                yield self._guarded(place, lambda at: chunks.chunk_bytes(self.file, at))

    def _chunks(self, info: TopicInfo, span: Span) -> Iterator[Messages]:
        """Yield the messages of a topic by chunks.

        Raises: LogError when there are others than the statistics of the file count
        """
        count = 0
        for place in self.places:
            if place.indexes.keys() & set(info.channels) and span.meets(place):
                found = self._guarded(place, lambda at: self._read_chunk(at, info.channels))
                count += len(found.offsets)
                found = found.within(span)
                if len(found.offsets):
                    yield found
        if span is ALWAYS and count != info.messages:
            raise self.error(
                f"{info.name}: {count} messages found, its statistics tell of {info.messages}"
            )

    def _guarded(self, place: ChunkPlace, read: Any) -> Any:  # noqa: ANN401
        """Read a chunk; damage is told with its place."""
        try:
            return read(place)
        except BROKEN as error:
            raise self.error(f"damaged chunk at byte {place.offset}: {why(error)}") from None

    def _read_chunk(self, place: ChunkPlace, channels: tuple[int, ...]) -> Messages:
        data = chunks.chunk_bytes(self.file, place)
        offsets = chunks.message_offsets(self.file, place, channels, data)
        if not len(offsets):
            return Messages(data, offsets, offsets, offsets.astype(np.uint64))
        heads = chunks.heads(data, offsets)
        sizes = heads["length"].astype(np.int64) + 9 - MESSAGE_HEAD.size
        return Messages(data, offsets, sizes, heads["log_time"])

    def _undecodable(self, topic: str, reason: str) -> UndecodableError:
        return UndecodableError(f"{self.path}: {topic}: {reason}")

    def error(self, text: str) -> LogError:
        """Return the error that names this file."""
        return LogError(f"{self.path}: {text}")


def open_part(path: Path) -> Part:
    """Open one finished file.

    Raises: LogError when the file cannot be read or is no complete log
    """
    file = open_regular(path, LogError)
    try:
        return Part(path, file)
    except LogError:
        file.close()
        raise


def _topics(found: summary.Summary) -> dict[str, TopicInfo]:
    counts = found.statistics.channel_message_counts if found.statistics else {}
    topics: dict[str, TopicInfo] = {}
    for number, channel in sorted(found.channels.items()):
        name, count = channel.topic, counts.get(number, 0)
        one = TopicInfo(
            name, count, (number,), coding.of_channel(channel, found.schemas.get(channel.schema_id))
        )
        topics[name] = _together(topics[name], one) if name in topics else one
    return topics


def _together(a: TopicInfo, b: TopicInfo) -> TopicInfo:
    """Join two channels of one topic."""
    shared = a.coding if a.fields == b.fields else coding.undecoded("its channels differ in fields")
    return TopicInfo(a.name, a.messages + b.messages, a.channels + b.channels, shared)
