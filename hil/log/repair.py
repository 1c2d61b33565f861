"""What can be saved from a damaged log: every whole chunk, attachment and metadata record.

A chunk counts as whole when its checksum is right and every record in it is a message of a topic
that is described. Nothing is guessed: what is not whole is left out and told.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema

from hil.errors import LogError
from hil.log import chunks, summary
from hil.log.part import BROKEN, why
from hil.log.records import MAGIC, MESSAGE

_BODIES = (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.SCHEMA, Opcode.CHANNEL)
_KNOWN = {int(opcode) for opcode in Opcode}
_LARGEST = 1 << 30
_STEP = 1 << 20


class Salvage(NamedTuple):
    """What a damaged file describes, how many of its chunks are whole, and what is lost."""

    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    metadata: dict[str, dict[str, str]]
    attachments: list[tuple[str, str, bytes]]
    whole: list[int]
    lost: list[str]


def survey(path: Path) -> Salvage:
    """Go through a file and tell what can be saved from it.

    Raises: LogError when it cannot be read, is empty, of another program or of a newer format
    """
    found = Salvage({}, {}, {}, [], [], [])
    with _opened(path) as file:
        try:
            summary.check_magic(file)
            for offset, opcode, body in _records(file, found.lost):
                _take(found, offset, opcode, body)
        except (_Refused, ValueError) as error:
            raise LogError(f"{path}: nothing can be saved: {error}") from None
    if not found.channels:
        raise LogError(f"{path}: nothing can be saved: it ends before its topics are described")
    return found


def whole_chunks(path: Path, found: Salvage) -> Iterator[bytes]:
    """Yield the messages of each whole chunk, in the order of the file."""
    with _opened(path) as file:
        for offset in found.whole:
            yield _messages(chunks.unpacked(summary.read_at(file, offset, Opcode.CHUNK)), found)


class _Refused(Exception):  # noqa: N818  # carries a reason, is no error by itself
    """The file is none of which anything may be taken."""


def _opened(path: Path) -> IO[bytes]:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None


def _take(found: Salvage, offset: int, opcode: int, body: bytes) -> None:
    """Take one record; the copies in the summary say the same again."""
    try:
        if opcode == Opcode.CHUNK:
            _messages(chunks.unpacked(body), found)
            found.whole.append(offset)
        elif opcode == Opcode.HEADER:
            _check_header(body)
        elif opcode == Opcode.METADATA:
            record = Metadata.read(_stream(body))
            found.metadata.setdefault(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            found.attachments.append(summary.parse_attachment(body))
        else:
            _describe(found, opcode, body)
    except BROKEN as error:
        found.lost.append(f"{Opcode(opcode).name.lower()} at byte {offset}: {why(error)}")


def _check_header(body: bytes) -> None:
    try:
        summary.check_format(Header.read(_stream(body)).library)
    except ValueError as error:
        raise _Refused(str(error)) from None


def _describe(found: Salvage, opcode: int, body: bytes) -> None:
    """Take a schema or a channel, in front of the chunks or inside of one."""
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(_stream(body))
        found.schemas.setdefault(schema.id, schema)
    else:
        channel = Channel.read(_stream(body))
        found.channels.setdefault(channel.id, channel)


def _messages(data: bytes, found: Salvage) -> bytes:
    """Return the Message records of a chunk; take what it describes, as other writers do there.

    Raises: ValueError when a record is no message of a described topic
    """
    kept = []
    for opcode, body in summary.records(data):
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            _describe(found, opcode, body)
        elif opcode != MESSAGE or int.from_bytes(body[:2], "little") not in found.channels:
            raise ValueError("records that are no messages of its topics")
        else:
            kept.append(summary.RECORD.pack(MESSAGE, len(body)) + body)
    return b"".join(kept)


def _records(file: IO[bytes], lost: list[str]) -> Iterator[tuple[int, int, bytes]]:
    """Yield (offset, opcode, body); behind a damaged length look for the next whole chunk."""
    size = file.seek(0, 2)
    offset = len(MAGIC)
    while offset + summary.RECORD.size <= size:
        file.seek(offset)
        opcode, length = summary.RECORD.unpack(file.read(summary.RECORD.size))
        end = offset + summary.RECORD.size + length
        if opcode == Opcode.FOOTER:
            return
        if opcode not in _KNOWN or end > size or (opcode in _BODIES and length > _LARGEST):
            following = _next_chunk(file, offset + 1, size)
            if following is None:
                lost.append(f"the last {size - offset} bytes, from byte {offset} on")
                return
            lost.append(f"{following - offset} bytes from byte {offset} on")
            offset = following
            continue
        if opcode in _BODIES or opcode == Opcode.HEADER:
            yield offset, opcode, file.read(length)
        offset = end


def _next_chunk(file: IO[bytes], offset: int, size: int) -> int | None:
    """Find the next place where a Chunk record begins that is whole by its checksum."""
    while offset < size:
        file.seek(offset)
        window = file.read(_STEP + summary.RECORD.size)
        place = window.find(bytes([Opcode.CHUNK]))
        while 0 <= place < _STEP:
            if _is_chunk(file, offset + place, size):
                return offset + place
            place = window.find(bytes([Opcode.CHUNK]), place + 1)
        offset += _STEP
    return None


def _is_chunk(file: IO[bytes], offset: int, size: int) -> bool:
    file.seek(offset)
    head = file.read(summary.RECORD.size + 40)
    if len(head) < summary.RECORD.size + 40:
        return False
    _, length = summary.RECORD.unpack_from(head)
    _, _, _, _, named = struct.unpack_from("<QQQII", head, summary.RECORD.size)
    # The length must lie inside the file, the name of the compression be short: then look closer.
    if not 40 <= length <= min(size - offset, _LARGEST) or named > 8:
        return False
    try:
        chunks.unpacked(summary.read_at(file, offset, Opcode.CHUNK))
    except BROKEN:
        return False
    return True


def _stream(body: bytes) -> Any:  # noqa: ANN401
    return ReadDataStream(BytesIO(body))
