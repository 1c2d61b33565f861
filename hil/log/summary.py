"""The end of an MCAP file: what it holds and where, read without touching the messages."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import IO, Any, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from hil.log.records import FORMAT, LIBRARY, MAGIC

RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI8s")
_SUMMARY_OFFSET = struct.Struct("<BQQ")
_CHUNK_INDEX = struct.Struct("<QQQQI")
_LARGEST = 1 << 30
BROKEN = (
    McapError,
    ValueError,
    KeyError,
    OSError,
    RuntimeError,
    OverflowError,
    MemoryError,
    struct.error,
    zstandard.ZstdError,
)
"""What reading damaged bytes may raise."""

INDEX_HEAD = 15  # of a message index: opcode, length, channel, bytes of the entries


class ChunkPlace(NamedTuple):
    """Where a chunk lies, its span in log time, and the index of each channel behind it.

    A channel whose index lies at 0 has none: its messages are found by walking through the chunk.
    `bare` are messages that lie in the file without a chunk around them, one after the other.
    """

    start_ns: int
    end_ns: int
    offset: int
    length: int
    indexes: dict[int, int]
    index_bytes: int
    bare: bool = False


class Summary(NamedTuple):
    """What a finished file says of itself; without statistics when it has no summary."""

    header: Header
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    statistics: Statistics | None
    chunk_records: tuple[bytes, ...]
    attachments: tuple[AttachmentIndex, ...]
    metadata: tuple[MetadataIndex, ...]
    start: int = 0
    """Where it begins in the file; 0: there is none."""
    footer_offset: int = 0
    groups: tuple[tuple[int, int, int], ...] = ()
    """(opcode, start, length) of the groups of records in it, as it tells them."""

    def is_index(self) -> bool:
        """Whether every message and every other record of the file is found through it."""
        told = self.statistics
        if told is None or not told.channel_message_counts.keys() <= self.channels.keys():
            return False
        return (
            told.message_count, told.chunk_count, told.attachment_count, told.metadata_count,
        ) == (
            sum(indexed_messages(body) for body in self.chunk_records), len(self.chunk_records),
            len(self.attachments), len(self.metadata),
        )  # fmt: skip

    def span(self) -> tuple[int, int]:
        """Return log time of the first and of the last message [ns], 0 when there is none.

        By the index, since some writers' statistics are wrong in it.
        """
        spans = [_CHUNK_INDEX.unpack_from(body) for body in self.chunk_records]
        filled = [one for one in spans if one[-1]]
        if filled:
            return min(one[0] for one in filled), max(one[1] for one in filled)
        told = self.statistics
        return (told.message_start_time, told.message_end_time) if told else (0, 0)


def why(error: BaseException) -> str:
    """Return what an exception says, or its name when it says nothing."""
    return str(error) or type(error).__name__


def check_magic(file: IO[bytes]) -> None:
    """Tell an MCAP file from anything else by its first bytes.

    Raises: ValueError
    """
    file.seek(0)
    head = file.read(len(MAGIC))
    if not head:
        raise ValueError("the file is empty")
    if head != MAGIC[: len(head)]:
        raise ValueError("it is no MCAP file")


def format_of(library: str) -> int | None:
    """Return the version of the log format, by the header of a file; None: a file of others.

    Raises: ValueError for a file of ours that is newer than this program
    """
    number = library.removeprefix(LIBRARY)
    if library == number:
        return None
    if not (number.isascii() and number.isdigit() and len(number) < 5) or int(number) > FORMAT:
        raise ValueError(f"it is of the newer log format {number}; this version reads {FORMAT}")
    return int(number)


def read_summary(file: IO[bytes]) -> Summary:
    """Read header, footer and summary, checked against their checksum.

    Raises: ValueError with what is wrong
    """
    check_magic(file)
    header = Header.read(_stream(read_at(file, len(MAGIC), Opcode.HEADER)))
    format_of(header.library)
    start, footer_offset, data = _summary_bytes(file)
    found: dict[int, list[bytes]] = {}
    for opcode, body in records(data):
        found.setdefault(opcode, []).append(body)
    statistics = [Statistics.read(_stream(body)) for body in found.get(Opcode.STATISTICS, [])]
    schemas = [Schema.read(_stream(body)) for body in found.get(Opcode.SCHEMA, [])]
    channels = [Channel.read(_stream(body)) for body in found.get(Opcode.CHANNEL, [])]
    return Summary(
        header,
        {schema.id: schema for schema in schemas},
        {channel.id: channel for channel in channels},
        statistics[0] if statistics else None,
        tuple(found.get(Opcode.CHUNK_INDEX, [])),
        tuple(AttachmentIndex.read(_stream(b)) for b in found.get(Opcode.ATTACHMENT_INDEX, [])),
        tuple(MetadataIndex.read(_stream(b)) for b in found.get(Opcode.METADATA_INDEX, [])),
        start,
        footer_offset,
        tuple(_SUMMARY_OFFSET.unpack(b) for b in found.get(Opcode.SUMMARY_OFFSET, [])),
    )


def _summary_bytes(file: IO[bytes]) -> tuple[int, int, bytes]:
    """Return where the summary begins (0: nowhere), where the footer does, and what is between."""
    size = file.seek(0, 2)
    if size < len(MAGIC) + _FOOTER.size:
        raise ValueError("it is cut off: nothing but its beginning is there")
    file.seek(size - _FOOTER.size)
    tail = file.read(_FOOTER.size)
    opcode, length, start, _, crc, magic = _FOOTER.unpack(tail)
    if (opcode, length, magic) != (Opcode.FOOTER, 20, MAGIC):
        raise ValueError("it is cut off or was never finished; `hil repair` saves what is whole")
    if start and not len(MAGIC) <= start <= size - _FOOTER.size:
        raise ValueError("its end is damaged: the summary lies outside the file")
    file.seek(start or size - _FOOTER.size)
    data = file.read(size - _FOOTER.size - start) if start else b""
    if crc and zlib.crc32(tail[:25], zlib.crc32(data)) != crc:
        raise ValueError("its end is damaged: the checksum (CRC) of the summary does not match")
    return start, size - _FOOTER.size, data


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield (opcode, body) of consecutive records.

    Raises: ValueError when one reaches beyond the data
    """
    offset = 0
    while offset < len(data):
        if offset + RECORD.size > len(data):
            raise ValueError("a record that is cut off")
        opcode, length = RECORD.unpack_from(data, offset)
        start = offset + RECORD.size
        offset = start + length
        if offset > len(data):
            raise ValueError(f"a record of {length} bytes that is cut off")
        yield opcode, data[start:offset]


def read_at(file: IO[bytes], offset: int, opcode: int) -> bytes:
    """Return the body of the record at an offset.

    Raises: ValueError when there is another one, or none
    """
    file.seek(offset)
    head = file.read(RECORD.size)
    if len(head) < RECORD.size:
        raise ValueError(f"a record that is cut off at byte {offset}")
    found, length = RECORD.unpack(head)
    if found != opcode or length > _LARGEST:
        raise ValueError(f"no record of kind {opcode} at byte {offset}")
    if offset + RECORD.size + length > file.seek(0, 2):
        raise ValueError(f"a record that is cut off at byte {offset}")
    file.seek(offset + RECORD.size)
    return file.read(length)


def check_groups(file: IO[bytes], told: Summary) -> None:
    """Check that the groups of the summary begin and end where it says, each of one kind.

    Raises: ValueError when one does not
    """
    for opcode, start, length in told.groups:
        if not told.start <= start <= start + length <= told.footer_offset:
            raise ValueError("a group of the summary that lies outside of it")
        file.seek(start)
        if any(found != opcode for found, _ in records(file.read(length))):
            raise ValueError("a group of the summary with records of another kind")


def indexed_messages(body: bytes) -> int:
    """Return how many messages the indexes behind a chunk have room for, by its index record."""
    *_, size = _CHUNK_INDEX.unpack_from(body)
    (index_bytes,) = struct.unpack_from("<Q", body, _CHUNK_INDEX.size + size)
    entries: int = index_bytes - INDEX_HEAD * (size // 10)
    return entries // 16


def chunk_place(body: bytes) -> ChunkPlace:
    """Read a chunk index record."""
    start_ns, end_ns, offset, length, size = _CHUNK_INDEX.unpack_from(body)
    at = _CHUNK_INDEX.size
    pairs = struct.iter_unpack("<HQ", body[at : at + size])
    (index_bytes,) = struct.unpack_from("<Q", body, at + size)
    return ChunkPlace(start_ns, end_ns, offset, length, dict(pairs), index_bytes)


def read_metadata(file: IO[bytes], index: MetadataIndex) -> tuple[str, dict[str, str]]:
    """Return name and values of a metadata record."""
    found = Metadata.read(_stream(read_at(file, index.offset, Opcode.METADATA)))
    return found.name, found.metadata


def read_attachment(file: IO[bytes], index: AttachmentIndex) -> tuple[str, str, bytes]:
    """Return (name, media type, content), checked against its checksum.

    Raises: ValueError when it does not match
    """
    return parse_attachment(read_at(file, index.offset, Opcode.ATTACHMENT))


def parse_attachment(body: bytes) -> tuple[str, str, bytes]:
    """Return (name, media type, content) of an attachment record; ValueError as above."""
    (crc,) = struct.unpack("<I", body[-4:])
    stream = _stream(body[16:])
    name, media_type = stream.read_prefixed_string(), stream.read_prefixed_string()
    content = stream.read(stream.read8())
    if crc and zlib.crc32(body[:-4]) != crc:
        raise ValueError(f"attachment {name}: the checksum (CRC) does not match")
    return name, media_type, content


def _stream(body: bytes) -> Any:  # noqa: ANN401
    return ReadDataStream(BytesIO(body))
