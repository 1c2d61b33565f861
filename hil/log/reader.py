"""Read a log: fixed-size topics as numpy blocks, events and frames one by one.

What a topic's bytes mean is taken from the definition in the file, not from today's declaration,
so a log stays readable when a topic has got another field.
"""

from __future__ import annotations

import struct
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple

import numpy as np
import zstandard
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Channel, ChunkIndex, Schema
from mcap.summary import Summary
from numpy.typing import NDArray

from hil.errors import LogError
from hil.log import chunks
from hil.records import PAYLOAD_OFFSET, Field, Layout, parse_definition

_BROKEN = (
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


class Log:
    """An open log. Its methods raise LogError, naming the file, when the bytes are damaged."""

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self.path = path
        self._file = file
        try:
            reader = make_reader(file, validate_crcs=True)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise ValueError("it has no summary")
            self._summary = summary
            self.topics = _topics(summary)
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            self.attachments = _attachments(reader)
        except _BROKEN as error:
            raise self._error(f"no complete MCAP log: {_why(error)}") from None
        self.start_ns: int = summary.statistics.message_start_time
        self.end_ns: int = summary.statistics.message_end_time

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; arrays that were read stay valid."""
        self._file.close()

    def blocks(self, topic: str) -> Iterator[NDArray[Any]]:
        """Yield the messages of a fixed-size topic as one structured array per chunk.

        Fields have the names, types and units of `topics[topic].fields`; the memory needed is
        that of one chunk, whatever the length of the log.

        Raises: LogError when there is no such topic or its messages vary in size
        """
        info = self._topic(topic)
        if info.layout.variable:
            raise self._error(f"{topic} varies in size: read it with records()")
        dtype = np.dtype(info.layout.numpy_spec)
        for data, offsets, sizes in self._chunks(info):
            if (sizes != dtype.itemsize).any():
                raise self._error(f"{topic} has messages that are not {dtype.itemsize} bytes long")
            yield chunks.gather(data, offsets, PAYLOAD_OFFSET, dtype)

    def array(self, topic: str) -> NDArray[Any]:
        """Return all messages of a fixed-size topic as one structured array.

        Raises: LogError as `blocks`
        """
        info = self._topic(topic)
        blocks = list(self.blocks(topic))
        # Filled in place, since np.concatenate would pack the fields against their alignment.
        whole = np.empty(sum(map(len, blocks)), np.dtype(info.layout.numpy_spec))
        start = 0
        for block in blocks:
            whole[start : start + len(block)] = block
            start += len(block)
        return whole

    def records(self, topic: str) -> Iterator[Any]:
        """Yield the messages of any topic as named tuples, in the order of the file.

        Raises: LogError when there is no such topic
        """
        info = self._topic(topic)
        record = _named_tuple("Record", [field.name for field in info.fields])
        for data, offsets, sizes in self._chunks(info):
            starts = offsets + PAYLOAD_OFFSET
            for start, end in zip(starts.tolist(), (starts + sizes).tolist(), strict=True):
                try:
                    values = info.layout.unpack(data[start:end])
                except ValueError as error:
                    raise self._error(f"{topic}: {error}") from None
                yield record._make(values)

    def frames(self, direction: str) -> Iterator[tuple[int, int, bytes]]:
        """Yield (tick, t_ns, batch) of the frames that were "sent" or "received".

        Raises: LogError when the log has no such topic
        """
        for record in self.records(f"/frames/{direction}"):
            yield tuple(record)

    def _chunks(self, info: TopicInfo) -> Iterator[tuple[bytes, NDArray[Any], NDArray[Any]]]:
        """Yield records, offsets and payload sizes of each chunk that has the topic."""
        for index in self._summary.chunk_indexes:
            if info.channel_id not in index.message_index_offsets:
                continue
            try:
                found = self._read_chunk(index, info.channel_id)
            except _BROKEN as error:
                place = f"chunk at byte {index.chunk_start_offset}"
                raise self._error(f"damaged {place}: {_why(error)}") from None
            yield found

    def _read_chunk(
        self, index: ChunkIndex, channel: int
    ) -> tuple[bytes, NDArray[np.int64], NDArray[np.int64]]:
        data = chunks.chunk_bytes(self._file, index)
        offsets = chunks.message_offsets(self._file, index, channel)
        return data, offsets, chunks.check_heads(data, offsets, channel)

    def _topic(self, name: str) -> TopicInfo:
        if name not in self.topics:
            raise self._error(f"no topic {name}; it has {', '.join(sorted(self.topics))}")
        return self.topics[name]

    def _error(self, text: str) -> LogError:
        return LogError(f"{self.path}: {text}")


def open_log(path: Path | str) -> Log:
    """Open a finished log.

    Raises: LogError when the file cannot be read or is no complete log
    """
    path = Path(path)
    try:
        file = path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None
    try:
        return Log(path, file)
    except LogError:
        file.close()
        raise


def _why(error: BaseException) -> str:
    return str(error) or type(error).__name__


def _topics(summary: Summary) -> dict[str, TopicInfo]:
    assert summary.statistics is not None
    counts = summary.statistics.channel_message_counts
    topics = {}
    for number, channel in sorted(summary.channels.items()):
        fields = _fields(channel, summary.schemas.get(channel.schema_id))
        count = counts.get(number, 0)
        topics[channel.topic] = TopicInfo(channel.topic, fields, count, number, Layout(fields))
    return topics


def _fields(channel: Channel, schema: Schema | None) -> tuple[Field, ...]:
    if schema is None or (channel.message_encoding, schema.encoding) != ("cdr", "ros2msg"):
        raise ValueError(f"{channel.topic} is not cdr with a ros2msg schema")
    return parse_definition(schema.data.decode())


def _attachments(reader: McapReader) -> dict[str, Attachment]:
    return {
        found.name: Attachment(found.name, found.media_type, found.data)
        for found in reader.iter_attachments()
    }
