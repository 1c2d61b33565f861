"""The end of an MCAP file: what it holds and where, read without touching the messages."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import IO, Any, NamedTuple

from mcap.data_stream import ReadDataStream
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
_CHUNK_INDEX = struct.Struct("<QQQQI")
_LARGEST = 1 << 30


class ChunkPlace(NamedTuple):
    """Where a chunk lies, its span in log time, and the index of each channel behind it."""

    start_ns: int
    end_ns: int
    offset: int
    length: int
    indexes: dict[int, int]
    index_bytes: int


class Summary(NamedTuple):
    """What a finished file says of itself."""

    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    statistics: Statistics
    chunk_records: tuple[bytes, ...]
    attachments: tuple[AttachmentIndex, ...]
    metadata: tuple[MetadataIndex, ...]


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


def check_format(library: str) -> None:
    """Refuse a file of ours that is newer than this program.

    Raises: ValueError
    """
    number = library.removeprefix(LIBRARY)
    if library != number and (not number.isdigit() or int(number) > FORMAT):
        raise ValueError(f"it is of the newer log format {number}; this version reads {FORMAT}")


def read_summary(file: IO[bytes]) -> Summary:
    """Read header, footer and summary, checked against their checksum.

    Raises: ValueError with what is wrong
    """
    check_magic(file)
    header = read_at(file, len(MAGIC), Opcode.HEADER)
    check_format(Header.read(_stream(header)).library)
    data = _summary_bytes(file)
    found: dict[int, list[bytes]] = {}
    for opcode, body in records(data):
        found.setdefault(opcode, []).append(body)
    statistics = [Statistics.read(_stream(body)) for body in found.get(Opcode.STATISTICS, [])]
    if not statistics:
        raise ValueError("it has no summary")
    schemas = [Schema.read(_stream(body)) for body in found.get(Opcode.SCHEMA, [])]
    channels = [Channel.read(_stream(body)) for body in found.get(Opcode.CHANNEL, [])]
    return Summary(
        {schema.id: schema for schema in schemas},
        {channel.id: channel for channel in channels},
        statistics[0],
        tuple(found.get(Opcode.CHUNK_INDEX, [])),
        tuple(AttachmentIndex.read(_stream(b)) for b in found.get(Opcode.ATTACHMENT_INDEX, [])),
        tuple(MetadataIndex.read(_stream(b)) for b in found.get(Opcode.METADATA_INDEX, [])),
    )


def _summary_bytes(file: IO[bytes]) -> bytes:
    size = file.seek(0, 2)
    if size < len(MAGIC) + _FOOTER.size:
        raise ValueError("it is cut off: nothing but its beginning is there")
    file.seek(size - _FOOTER.size)
    tail = file.read(_FOOTER.size)
    opcode, length, start, _, crc, magic = _FOOTER.unpack(tail)
    if (opcode, length, magic) != (Opcode.FOOTER, 20, MAGIC):
        raise ValueError("it is cut off or was never finished; `hil repair` saves what is whole")
    if start == 0:
        raise ValueError("it has no summary")
    if not len(MAGIC) <= start <= size - _FOOTER.size:
        raise ValueError("its end is damaged: the summary lies outside the file")
    file.seek(start)
    data = file.read(size - _FOOTER.size - start)
    if crc and zlib.crc32(tail[:25], zlib.crc32(data)) != crc:
        raise ValueError("its end is damaged: the checksum (CRC) of the summary does not match")
    return data


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
    body = file.read(length)
    if len(body) < length:
        raise ValueError(f"a record that is cut off at byte {offset}")
    return body


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
