"""The records of an MCAP file one after the other: what is in it, whatever its index says."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from typing import IO, Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, Metadata, MetadataIndex, Schema, Statistics

from hil.log import chunks, summary
from hil.log.chunks import Contents
from hil.log.records import MAGIC, MESSAGE
from hil.log.summary import BROKEN, RECORD, ChunkPlace, Summary, why

_BARE_BYTES = 1 << 20


class Record(NamedTuple):
    """One record of a file: where it begins and how long it is altogether."""

    offset: int
    opcode: int
    size: int


class Section:
    """What has been found in a data section, record by record."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._bare: list[Record] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()
        self.places: list[ChunkPlace] = []
        self.attachments: list[AttachmentIndex] = []
        self.metadata: list[MetadataIndex] = []
        self.start_ns, self.end_ns = 0, 0

    def take(self, record: Record) -> None:
        """Take a record.

        Raises: ValueError when it is damaged
        """
        if record.opcode == MESSAGE:
            self._bare.append(record)
            if record.offset + record.size - self._bare[0].offset > _BARE_BYTES:
                self.end_run()
            return
        self.end_run()
        if record.opcode == Opcode.CHUNK:
            self.take_messages(record, chunks.contents(chunks.unpacked(self._body(record))))
        elif record.opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            self.describe(record.opcode, self._body(record))
        elif record.opcode == Opcode.ATTACHMENT:
            self._attachment(record)
        elif record.opcode == Opcode.METADATA:
            name = Metadata.read(stream(self._body(record))).name
            self.metadata.append(MetadataIndex(record.offset, record.size, name))

    def _body(self, record: Record) -> bytes:
        return summary.read_at(self._file, record.offset, record.opcode)

    def end_run(self) -> None:
        """Take the messages that lie in the file without a chunk, up to here."""
        if not self._bare:
            return
        first, last = self._bare[0], self._bare[-1]
        whole = Record(first.offset, MESSAGE, last.offset + last.size - first.offset)
        self._bare = []
        self._file.seek(whole.offset)
        self.take_messages(whole, chunks.contents(self._file.read(whole.size)))

    def take_messages(self, record: Record, found: Contents) -> None:
        """Take the messages of a chunk, or of a run without one."""
        for opcode, body in found.described:
            self.describe(opcode, body)
        counts = found.counts()
        unknown = counts.keys() - self.channels.keys()
        if unknown:
            raise ValueError(f"messages of channel {min(unknown)}, which is not described")
        times = found.times
        start, end = (int(times.min()), int(times.max())) if len(times) else (0, 0)
        if counts:
            self.start_ns = min(self.start_ns, start) if self.counts else start
            self.end_ns = max(self.end_ns, end)
        self.counts.update(counts)
        indexes, bare = dict.fromkeys(counts, 0), record.opcode == MESSAGE
        self.places.append(
            ChunkPlace(start, end, record.offset, record.size, indexes, 0, bare=bare)
        )

    def describe(self, opcode: int, body: bytes) -> None:
        """Take a schema or a channel; one that is described twice must be so in the same words.

        Raises: ValueError when it is not
        """
        known: dict[int, Any] = self.schemas if opcode == Opcode.SCHEMA else self.channels
        kind: Any = Schema if opcode == Opcode.SCHEMA else Channel
        found = kind.read(stream(body))
        if known.setdefault(found.id, found) != found:
            raise ValueError(f"{kind.__name__.lower()} {found.id} is described twice, differently")

    def statistics(self) -> Statistics:
        """Return the statistics as a file has them."""
        chunk_count = sum(not place.bare for place in self.places)
        return Statistics(
            attachment_count=len(self.attachments), channel_count=len(self.channels),
            channel_message_counts=dict(self.counts), chunk_count=chunk_count,
            message_count=self.counts.total(), message_end_time=self.end_ns,
            message_start_time=self.start_ns, metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )  # fmt: skip

    def _attachment(self, record: Record) -> None:
        body = self._body(record)
        name, kind, content = summary.parse_attachment(body)
        log_time, create_time = (int.from_bytes(body[i : i + 8], "little") for i in (0, 8))
        self.attachments.append(
            AttachmentIndex(
                record.offset, record.size, create_time, log_time, len(content), name, kind
            )
        )


def records_of(file: IO[bytes]) -> Iterator[Record]:
    """Yield the records of a file from its header to the end of its data.

    Raises: ValueError when one reaches beyond the file
    """
    size, offset = file.seek(0, 2), len(MAGIC)
    while True:
        file.seek(offset)
        head = file.read(RECORD.size)
        if len(head) < RECORD.size:
            raise ValueError("its data do not end: it is cut off")
        opcode, length = RECORD.unpack(head)
        record = Record(offset, opcode, RECORD.size + length)
        if offset + record.size > size:
            raise ValueError(f"a record of {length} bytes that is cut off at byte {offset}")
        yield record
        if opcode in {Opcode.DATA_END, Opcode.FOOTER}:
            return
        offset += record.size


def walked(file: IO[bytes], told: Summary) -> tuple[Summary, tuple[ChunkPlace, ...]]:
    """Return what a file says of itself and where its messages lie, from its data alone.

    Raises: ValueError naming the damaged record, or when its statistics count other messages
    """
    section = Section(file)
    section.schemas |= told.schemas  # others may describe a channel behind its messages
    section.channels |= told.channels
    for record in records_of(file):
        try:
            section.take(record)
        except BROKEN as error:
            raise ValueError(f"damaged record at byte {record.offset}: {why(error)}") from None
    section.end_run()
    found = told._replace(
        chunk_records=(),
        schemas=section.schemas, channels=section.channels, statistics=section.statistics(),
        attachments=tuple(section.attachments), metadata=tuple(section.metadata),
    )  # fmt: skip
    check_counts(told.statistics, section)
    return found, tuple(section.places)


def check_counts(told: Statistics | None, found: Section) -> None:
    """Hold the messages that were found against the statistics.

    Raises: ValueError when they are others
    """
    if told is None:
        return
    counts = {number: n for number, n in told.channel_message_counts.items() if n}
    if told.message_count != found.counts.total() or (counts and counts != found.counts):
        raise ValueError(
            f"its statistics tell of {told.message_count} messages, {found.counts.total()} are"
            " there: others by number or by channel"
        )


def stream(body: bytes) -> Any:  # noqa: ANN401
    """Return what mcap's own record classes read from."""
    return ReadDataStream(BytesIO(body))
