"""Whether a log is sound: every byte that a reader uses, held against all that is said of it.

Checksums (of the data, of each chunk, of attachments, of the summary) where the file has them, and
besides whatever it says twice: indexes against messages, summary against data, statistics against
the count. What no checksum covers is told, since a flipped bit in it cannot be seen.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex
from numpy.typing import NDArray

from hil.errors import LogError
from hil.files import open_regular
from hil.log import chunks, summary
from hil.log.chunks import Contents
from hil.log.data_section import Record, Section, check_counts, records_of, stream
from hil.log.records import MAGIC, MESSAGE
from hil.log.summary import BROKEN, Summary, why

_STEP = 1 << 20

Index = dict[int, tuple[NDArray[np.uint64], NDArray[np.int64]]]


class Soundness(NamedTuple):
    """Bytes of records that were read, and what cannot be told, or is told wrongly without harm."""

    size: int
    notes: tuple[str, ...]


def verify(path: Path) -> Soundness:
    """Read everything in a file and check it.

    Raises: LogError for the first that is not sound
    """
    with open_regular(path, LogError) as file:
        try:
            told = summary.read_summary(file)
            return _Check(file, told).run()
        except BROKEN as error:
            raise LogError(f"{path}: not sound: {why(error)}") from None


class _Chunk(NamedTuple):
    """The last chunk, until the indexes behind it have been read."""

    record: Record
    head: Chunk
    data: bytes


class _Check:
    """One pass through a file."""

    def __init__(self, file: IO[bytes], told: Summary) -> None:
        self._file = file
        self._told = told
        self._found = Section(file)
        self._last: _Chunk | None = None
        self._indexes: Index = {}
        self._offsets: dict[int, int] = {}
        self._chunk_indexes: list[ChunkIndex] = []
        self._size = 0
        self._bare = self._unchecked_chunks = self._unchecked_files = 0

    def run(self) -> Soundness:
        """Check the records one by one, then what is said of them all."""
        self._check_library()
        record = Record(0, 0, 0)
        for record in records_of(self._file):
            if record.opcode != Opcode.MESSAGE_INDEX:
                self._end_chunk(record.offset)
            try:
                self._take(record)
            except BROKEN as error:
                raise ValueError(f"damaged record at byte {record.offset}: {why(error)}") from None
        self._found.end_run()
        covered = self._check_data(record)
        self._check_summary(record)
        return Soundness(self._size, self._notes(covered=covered))

    def _check_library(self) -> None:
        if summary.format_of(self._told.header.library) is not None:
            _same("the profile", self._told.header.profile, "ros2")

    def _take(self, record: Record) -> None:
        if record.opcode == Opcode.MESSAGE_INDEX:
            self._take_index(record)
            return
        if record.opcode == Opcode.CHUNK:
            self._take_chunk(record)
            return
        if record.opcode == MESSAGE:
            self._bare += 1
            self._size += record.size
        elif record.opcode == Opcode.ATTACHMENT:
            body = summary.read_at(self._file, record.offset, record.opcode)
            self._unchecked_files += body[-4:] == bytes(4)
        self._found.take(record)

    def _take_chunk(self, record: Record) -> None:
        body = summary.read_at(self._file, record.offset, Opcode.CHUNK)
        data = chunks.unpacked(body)
        head = Chunk.read(stream(body))
        self._size += len(data)
        self._unchecked_chunks += head.uncompressed_crc == 0
        self._found.end_run()
        self._last = _Chunk(record, head, data)

    def _take_index(self, record: Record) -> None:
        """Take one message index, which must lie behind its chunk."""
        body = summary.read_at(self._file, record.offset, record.opcode)
        channel, size = int.from_bytes(body[:2], "little"), int.from_bytes(body[2:6], "little")
        if self._last is None or channel in self._indexes or size != len(body) - 6 or size % 16:
            raise ValueError("a message index that belongs to no chunk")
        self._indexes[channel] = chunks.index_entries(body[6:])
        self._offsets[channel] = record.offset

    def _end_chunk(self, end: int) -> None:
        """Take the messages of a chunk, and hold the indexes behind it against them."""
        if self._last is None:
            return
        record, head, data = self._last
        try:
            self._check_chunk(record, head, data)
        except BROKEN as error:
            raise ValueError(f"damaged chunk at byte {record.offset}: {why(error)}") from None
        behind = record.offset + record.size
        self._chunk_indexes.append(
            ChunkIndex(
                chunk_length=record.size, chunk_start_offset=record.offset,
                compression=head.compression, compressed_size=len(head.data),
                message_end_time=head.message_end_time,
                message_index_length=end - behind, message_index_offsets=self._offsets,
                message_start_time=head.message_start_time,
                uncompressed_size=head.uncompressed_size,
            )
        )  # fmt: skip
        self._last, self._indexes, self._offsets = None, {}, {}

    def _check_chunk(self, record: Record, head: Chunk, data: bytes) -> None:
        indexed = [offsets for _, offsets in self._indexes.values()]
        found = chunks.indexed_contents(data, np.concatenate([np.zeros(0, np.int64), *indexed]))
        self._found.take_messages(record, found)
        place = self._found.places[-1]
        if len(found.times):
            span = (head.message_start_time, head.message_end_time)
            _same("its span", span, (place.start_ns, place.end_ns))
        if self._indexes:
            _check_indexes(self._indexes, found)

    def _check_data(self, end: Record) -> bool:
        """Check the checksum of the data; false when there is none."""
        if end.opcode != Opcode.DATA_END:
            return False
        body = summary.read_at(self._file, end.offset, Opcode.DATA_END)
        if len(body) != 4:
            raise ValueError(f"an end of the data of {len(body)} bytes")
        crc = int.from_bytes(body, "little")
        header = len(MAGIC) + summary.RECORD.size
        header += len(summary.read_at(self._file, len(MAGIC), Opcode.HEADER))
        # Writers differ in whether magic and header count.
        begins = (0, len(MAGIC), header)
        if crc and not any(_crc(self._file, begin, end.offset) == crc for begin in begins):
            raise ValueError("the checksum (CRC) of the data does not match")
        return bool(crc)

    def _check_summary(self, end: Record) -> None:
        """Hold the summary against the data."""
        told, found = self._told, self._found
        behind = end.offset + (end.size if end.opcode == Opcode.DATA_END else 0)
        _same("the start of the summary", told.start or told.footer_offset, behind)
        for kind, of_summary, of_data in (
            ("schema", told.schemas, found.schemas),
            ("channel", told.channels, found.channels),
        ):
            for number, one in of_summary.items():
                _same(f"{kind} {number}", one, of_data.get(number, one))
        for kind, index, entries in (
            (
                "chunks",
                [ChunkIndex.read(stream(b)) for b in told.chunk_records],
                self._chunk_indexes,
            ),
            ("attachments", list(told.attachments), found.attachments),
            ("metadata", list(told.metadata), found.metadata),
        ):
            if index:
                _same(f"the index of {kind}", index, entries)
        self._check_statistics()
        summary.check_groups(self._file, told)

    def _check_statistics(self) -> None:
        told = self._told.statistics
        if told is None:
            return
        check_counts(told, self._found)
        counted = self._found.statistics()
        for name in ("attachment_count", "metadata_count", "chunk_count"):
            _same(f"statistics: {name}", getattr(told, name), getattr(counted, name))

    def _notes(self, *, covered: bool) -> tuple[str, ...]:
        """Name what no checksum covers, and what a writer told wrongly and no reader believes."""
        told, counted = self._told.statistics, self._found.statistics()
        notes = [
            f"its statistics tell another {name} than the messages have"
            for name in ("message_start_time", "message_end_time")
            if told is not None and getattr(told, name) != getattr(counted, name)
        ]
        return (*notes, *([] if covered else self._uncovered()))

    def _uncovered(self) -> list[str]:
        found = {
            "chunks": self._unchecked_chunks,
            "messages outside of chunks": self._bare,
            "attachments": self._unchecked_files,
            "metadata records": len(self._found.metadata),
        }
        return [f"no checksum covers {n} {what}" for what, n in found.items() if n]


def _check_indexes(indexes: Index, found: Contents) -> None:
    """Hold the message indexes of a chunk against its messages, all of them."""
    for channel in indexes.keys() | found.counts().keys():
        if channel not in indexes:
            raise ValueError(f"no message index of channel {channel}")
        times, offsets = indexes[channel]
        order = np.argsort(offsets, kind="stable")
        own = found.channels == channel
        if not (
            np.array_equal(offsets[order], found.offsets[own])
            and np.array_equal(times[order], found.times[own])
        ):
            raise ValueError(f"the message index of channel {channel} names other messages")


def _same(what: str, told: Any, found: Any) -> None:  # noqa: ANN401
    if told != found:
        raise ValueError(f"{what} is not what the data say")


def _crc(file: IO[bytes], begin: int, end: int) -> int:
    """Return the CRC-32 of a stretch of a file."""
    file.seek(begin)
    crc, rest = 0, end - begin
    while rest > 0:
        block = file.read(min(_STEP, rest))
        crc, rest = zlib.crc32(block, crc), rest - len(block)
    return crc
