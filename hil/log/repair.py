"""What can be saved from a damaged log: every whole chunk, message, attachment, metadata record.

A chunk counts as whole when its checksum is right and every record in it is a message of a topic
that is described. Nothing is guessed: what is not whole is left out and told.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema

from hil.errors import LogError
from hil.files import open_regular
from hil.log import chunks, summary
from hil.log.data_section import Record, stream
from hil.log.records import MAGIC, MESSAGE, MESSAGE_HEAD
from hil.log.summary import BROKEN, why

_BODIES = (
    Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.SCHEMA, Opcode.CHANNEL, MESSAGE,
)  # fmt: skip
_KNOWN = {int(opcode) for opcode in Opcode}
_LARGEST = 1 << 30
_STEP = 1 << 20


class Salvage:
    """What a damaged file describes, where its whole messages lie, and what is lost."""

    def __init__(self) -> None:
        self.header: Header | None = None
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: list[tuple[str, str, bytes]] = []
        self.whole: list[Record] = []
        """Chunks, and runs of messages that lie without one."""
        self.strangers = 0
        self.lost: list[str] = []


def survey(path: Path) -> Salvage:
    """Go through a file and tell what can be saved from it.

    Raises: LogError when it cannot be read, is empty, of another program or of a newer format
    """
    found = Salvage()
    with open_regular(path, LogError) as file:
        try:
            summary.check_magic(file)
            _take_summary(found, file)
            for offset, opcode, body in _records(file, found.lost):
                _take(found, offset, opcode, body)
        except (_Refused, ValueError) as error:
            raise LogError(f"{path}: nothing can be saved: {error}") from None
    if found.strangers:
        found.lost.append(f"{found.strangers} messages of no topic that is described")
    if found.lost and not found.channels:
        raise LogError(f"{path}: nothing can be saved: it ends before its topics are described")
    return found


def whole_messages(path: Path, found: Salvage) -> Iterator[bytes]:
    """Yield the messages of each whole chunk or run, in the order of the file."""
    with open_regular(path, LogError) as file:
        for record in found.whole:
            if record.opcode == MESSAGE:
                file.seek(record.offset)
                yield file.read(record.size)
            else:
                body = summary.read_at(file, record.offset, Opcode.CHUNK)
                yield _messages(chunks.unpacked(body), found)


class _Refused(Exception):  # noqa: N818  # carries a reason, is no error by itself
    """The file is none of which anything may be taken."""


def _take_summary(found: Salvage, file: IO[bytes]) -> None:
    """Take what a sound summary describes: the record in the data may be damaged."""
    try:
        told = summary.read_summary(file)
    except BROKEN:
        return
    found.schemas |= told.schemas
    found.channels |= told.channels


def _take(found: Salvage, offset: int, opcode: int, body: bytes) -> None:
    """Take one record; the copies in the summary say the same again."""
    try:
        if opcode == Opcode.CHUNK:
            _messages(chunks.unpacked(body), found)
            found.whole.append(Record(offset, opcode, summary.RECORD.size + len(body)))
        elif opcode == MESSAGE:
            _take_message(found, offset, body)
        elif opcode == Opcode.HEADER:
            found.header = _checked_header(body)
        elif opcode == Opcode.METADATA:
            record = Metadata.read(stream(body))
            found.metadata.setdefault(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            found.attachments.append(summary.parse_attachment(body))
        else:
            _describe(found, opcode, body)
    except BROKEN as error:
        found.lost.append(f"{Opcode(opcode).name.lower()} at byte {offset}: {why(error)}")


def _take_message(found: Salvage, offset: int, body: bytes) -> None:
    """Take a message that lies in the file without a chunk, to those before it."""
    if len(body) < MESSAGE_HEAD.size - 9:
        raise ValueError("it is cut off")
    if int.from_bytes(body[:2], "little") not in found.channels:
        found.strangers += 1
        return
    size = summary.RECORD.size + len(body)
    last = found.whole[-1] if found.whole else Record(0, 0, 0)
    if last.opcode == MESSAGE and last.offset + last.size == offset and last.size < _STEP:
        found.whole[-1] = last._replace(size=last.size + size)
    else:
        found.whole.append(Record(offset, MESSAGE, size))


def _checked_header(body: bytes) -> Header:
    header: Header = Header.read(stream(body))
    try:
        summary.format_of(header.library)
    except ValueError as error:
        raise _Refused(str(error)) from None
    return header


def _describe(found: Salvage, opcode: int, body: bytes) -> None:
    """Take a schema or a channel, in front of the chunks or inside of one."""
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(stream(body))
        found.schemas.setdefault(schema.id, schema)
    else:
        channel = Channel.read(stream(body))
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
        elif len(body) < MESSAGE_HEAD.size - summary.RECORD.size:
            raise ValueError("a message that is cut off")
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
    lost.append("its end: it is cut off or was never finished")


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
