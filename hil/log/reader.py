"""Read a log: fixed-size topics as numpy blocks, events and frames one by one.

What a topic's bytes mean is taken from the definition in the file, not from today's declaration,
so a log stays readable when a topic has got another field. A log that was written in segments
(`plant.0001.mcap`, `plant.0002.mcap`, ... and last `plant.mcap`) reads as one.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import LogError
from hil.log.coding import UndecodableError
from hil.log.part import ALWAYS, Attachment, Part, Span, TopicInfo, open_part
from hil.log.segments import segments_before

if TYPE_CHECKING:
    import pandas
    import polars


class Log:
    """An open log. Its methods raise LogError, naming the file, when the bytes are damaged."""

    def __init__(self, path: Path, parts: list[Part]) -> None:
        self.path = path
        self.parts = parts
        first, last = parts[0], parts[-1]
        self.metadata = first.metadata | last.metadata
        self.attachments: dict[str, Attachment] = last.attachments
        self.topics = self._topics()
        filled = [part for part in parts if part.messages]
        self.start_ns = filled[0].start_ns if filled else first.start_ns
        self.end_ns = filled[-1].end_ns if filled else last.end_ns
        self.format = first.format
        """Version of the log format; None: another program wrote it."""
        number = first.metadata.get("segment", {}).get("number", "1")
        self.continues = number != "1" or "continues" in first.metadata
        """Whether what came before the first message is not in it."""

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
        """Close the files; arrays that were read stay valid."""
        for part in self.parts:
            part.file.close()

    def blocks(self, topic: str, span: Span = ALWAYS) -> Iterator[NDArray[Any]]:
        """Yield the messages of a fixed-size topic as one structured array per chunk.

        Fields have the names, types and units of `topics[topic].fields`; the memory needed is
        that of one chunk, whatever the length of the log. With a `span` only the chunks that the
        index names for it are read.

        Raises: LogError when there is no such topic or its messages vary in size
        """
        for _, block in self.timed_blocks(topic, span):
            yield block

    def timed_blocks(
        self, topic: str, span: Span = ALWAYS
    ) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Yield (log times [ns], messages) by chunks, as `blocks`."""
        self._decodable(topic)
        if not self.topics[topic].coding.fixed:
            raise self.error(f"{topic} varies in size: read it with records()")
        for part in self.parts:
            if topic in part.topics:
                yield from part.blocks(topic, span)

    def array(self, topic: str, span: Span = ALWAYS) -> NDArray[Any]:
        """Return all messages of a fixed-size topic as one structured array.

        Raises: LogError as `blocks`
        """
        blocks = list(self.blocks(topic, span))
        # Filled in place, since np.concatenate would pack the fields against their alignment.
        spec = self._topic(topic).layout.numpy_spec
        whole = np.empty(sum(map(len, blocks)), np.dtype(spec))
        start = 0
        for block in blocks:
            whole[start : start + len(block)] = block
            start += len(block)
        return whole

    def records(self, topic: str, span: Span = ALWAYS) -> Iterator[Any]:
        """Yield the messages of any topic as named tuples, in the order of the file.

        A field whose name Python keeps for itself has the name of its place (`_1`).

        Raises: LogError when there is no such topic, UndecodableError when it is not decoded
        """
        for _, record in self.timed_records(topic, span):
            yield record

    def timed_records(self, topic: str, span: Span = ALWAYS) -> Iterator[tuple[int, Any]]:
        """Yield (log time [ns], message) one by one, as `records`."""
        self._decodable(topic)
        for part in self.parts:
            if topic in part.topics:
                yield from part.records(topic, span)

    def payloads(self, topic: str, span: Span = ALWAYS) -> Iterator[tuple[int, bytes]]:
        """Yield (log time [ns], bytes) of the messages of any topic, decodable or not.

        Raises: LogError when there is no such topic
        """
        self._topic(topic)
        for part in self.parts:
            if topic in part.topics:
                yield from part.payloads(topic, span)

    def frames(self, direction: str) -> Iterator[tuple[int, int, bytes]]:
        """Yield (tick, t_ns, batch) of the frames that were "sent" or "received".

        Raises: LogError when the log has no such topic
        """
        for record in self.records(f"/frames/{direction}"):
            yield tuple(record)

    def raw(self, span: Span = ALWAYS) -> Iterator[bytes]:
        """Yield the Message records of each chunk as they were put, one after the other.

        Raises: LogError when a chunk is damaged
        """
        for part in self.parts:
            yield from part.raw(span)

    def pandas(self, topic: str, span: Span = ALWAYS) -> pandas.DataFrame:
        """Return a topic as a pandas frame; `frame.attrs["units"]` has the units by column.

        Raises: LogError when there is no such topic, MissingExtraError without pandas
        """
        from hil.log.tables import pandas_frame  # noqa: PLC0415  # needs an extra

        return pandas_frame(self, topic, span)

    def polars(self, topic: str, span: Span = ALWAYS) -> polars.DataFrame:
        """Return a topic as a polars frame; `units` has the units by column.

        Raises: LogError when there is no such topic, MissingExtraError without polars
        """
        from hil.log.tables import polars_frame  # noqa: PLC0415  # needs an extra

        return polars_frame(self, topic, span)

    def units(self, topic: str) -> dict[str, str]:
        """Return the unit of each field of a topic that has one.

        Raises: LogError when there is no such topic
        """
        return {field.name: field.unit for field in self._topic(topic).fields if field.unit}

    def _topics(self) -> dict[str, TopicInfo]:
        """Return the topics of all parts together, which must agree on their fields."""
        topics: dict[str, TopicInfo] = {}
        for part in self.parts:
            for name, info in part.topics.items():
                known = topics.get(name)
                if known is not None and known.fields != info.fields:
                    raise part.error(f"{name} has other fields than in the segment before")
                count = info.messages + (known.messages if known else 0)
                topics[name] = info._replace(messages=count)  # numbers of channels: of the last
        return topics

    def _decodable(self, name: str) -> None:
        """Refuse a topic whose messages are not decoded, by the reason."""
        reason = self._topic(name).coding.reason
        if reason:
            raise UndecodableError(f"{self.path}: {name}: {reason}")

    def _topic(self, name: str) -> TopicInfo:
        if name not in self.topics:
            raise self.error(f"no topic {name}; it has {', '.join(sorted(self.topics))}")
        return self.topics[name]

    def error(self, text: str) -> LogError:
        """Return the error that names this log."""
        return LogError(f"{self.path}: {text}")


def open_log(path: Path | str) -> Log:
    """Open a finished log, with its earlier segments if it has any.

    Raises: LogError when a file cannot be read or is no complete log
    """
    path = Path(path)
    parts: list[Part] = []
    try:
        parts.append(open_part(path))
        if "segment" in parts[0].metadata:
            parts[:0] = [open_part(other) for other in segments_before(path)]
        return Log(path, parts)
    except LogError:
        for part in parts:
            part.file.close()
        raise
