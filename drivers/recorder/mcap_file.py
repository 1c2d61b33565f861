"""An MCAP file from packed Message records: chunks, index, checksums, summary, footer.

What is per message is done on whole chunks of bytes; everything else uses mcap's own record
classes. The file is valid after `finish` even when the disk filled up on the way.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from drivers.recorder.index import MessageIndex
from drivers.recorder.reserve import reserve as keep_free
from hil.log.records import FORMAT, LIBRARY, MAGIC

_INDEX_HEAD = struct.Struct("<BQHI")
_SPAN = struct.Struct("<9xQQQ")  # of a ChunkIndex record
_COUNT = struct.Struct("<HQ")
# Level 1 makes files 5 % larger than level 3 in three quarters of its time.
_LEVEL = 1
# Summary, footer and a last event need less than this, besides an index entry a chunk.
_ENDING_BYTES = 64 << 10
_ENDING_BYTES_A_CHUNK = 512


class _Writable(Protocol):
    def write(self, stream: RecordBuilder) -> None: ...


class _WrittenChunk(NamedTuple):
    """What the end of the file tells of a chunk, packed: a long log has many of them."""

    entry: bytes  # ChunkIndex record
    tally: bytes  # channel and messages, channel by channel
    crc_before: int

    def span(self) -> tuple[int, int, int]:
        """Return log time of the first and of the last message, and the offset in the file."""
        found: tuple[int, int, int] = _SPAN.unpack_from(self.entry)
        return found

    def messages(self) -> dict[int, int]:
        """Return how many messages the chunk has of each channel."""
        return dict(_COUNT.iter_unpack(self.tally))


def _bytes_of(*records: _Writable) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


class McapFile:
    """An MCAP file that is being written to an open descriptor.

    Methods raise OSError when the bytes could not be written; the file then ends where it ended
    before the call, and `finish` still makes it whole.
    """

    def __init__(
        self,
        fd: int,
        schemas: Sequence[Schema],
        channels: Sequence[Channel],
        header: Header | None = None,
    ) -> None:
        self._fd = fd
        self._size = 0
        self._crc = 0
        self._schemas = schemas
        self._channels = channels
        self._chunks: list[_WrittenChunk] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        header = header or Header("ros2", f"{LIBRARY}{FORMAT}")
        self._emit(MAGIC + _bytes_of(header, *schemas, *channels))

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._size

    @property
    def messages(self) -> int:
        """Messages in the chunks written so far."""
        return sum(sum(chunk.messages().values()) for chunk in self._chunks)

    def _emit(self, data: bytes) -> int:
        """Append to the file as a whole or not at all; return the offset."""
        start, rest = self._size, memoryview(data)
        try:
            while rest:
                rest = rest[os.write(self._fd, rest) :]
        except OSError:
            self._cut(start)
            raise
        self._size = start + len(data)
        self._crc = zlib.crc32(data, self._crc)
        return start

    def _cut(self, size: int) -> None:
        os.ftruncate(self._fd, size)
        os.lseek(self._fd, size, os.SEEK_SET)
        self._size = size

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write one Metadata record."""
        data = _bytes_of(Metadata(name, dict(values)))
        offset = self._emit(data)
        self._metadata.append(MetadataIndex(offset=offset, length=len(data), name=name))

    def add_attachment(self, name: str, media_type: str, content: bytes) -> None:
        """Write one Attachment record, its times zero: the log's clock starts with the run."""
        data = _bytes_of(Attachment(0, 0, name, media_type, content))
        offset = self._emit(data)
        index = AttachmentIndex(offset, len(data), 0, 0, len(content), name, media_type)
        self._attachments.append(index)

    def add_chunk(self, data: bytes, index: MessageIndex, *, reserve: bool = True) -> None:
        """Write whole Message records as one compressed chunk with its message index.

        Room for what ends the file is kept free behind it; the last chunk may take it (`reserve`).
        """
        compressed = self._compressor.compress(data)
        crc = zlib.crc32(data)
        chunk = Chunk("zstd", compressed, index.last_ns, index.first_ns, crc, len(data))
        record = _bytes_of(chunk)
        start, crc_before, offsets = self._size, self._crc, {}
        parts = [record]
        offset = start + len(record)
        for channel, found in index.channels.items():
            offsets[channel] = offset
            body = len(found.pairs)
            parts.append(_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + body, channel, body))
            parts.append(found.pairs)
            offset += _INDEX_HEAD.size + body
        if reserve:
            ending = _ENDING_BYTES + _ENDING_BYTES_A_CHUNK * (len(self._chunks) + 2)
            keep_free(self._fd, start, offset - start + ending)
        self._emit(b"".join(parts))
        chunk_index = ChunkIndex(
            chunk_length=len(record),
            chunk_start_offset=start,
            compression=chunk.compression,
            compressed_size=len(compressed),
            message_end_time=chunk.message_end_time,
            message_index_length=offset - start - len(record),
            message_index_offsets=offsets,
            message_start_time=chunk.message_start_time,
            uncompressed_size=len(data),
        )
        counts = [_COUNT.pack(number, found.messages) for number, found in index.channels.items()]
        self._chunks.append(_WrittenChunk(_bytes_of(chunk_index), b"".join(counts), crc_before))

    def finish(self) -> None:
        """Write summary and footer; on a full disk the last chunks make room for them.

        Raises: OSError when even a file without chunks cannot be finished
        """
        while True:
            try:
                self._emit(self._end())
                os.ftruncate(self._fd, self._size)  # gives back what was kept free
            except OSError:
                if not self._chunks:
                    raise
                last = self._chunks.pop()
                self._cut(last.span()[2])
                self._crc = last.crc_before
                self._metadata = [m for m in self._metadata if m.offset < self._size]
            else:
                return

    def _end(self) -> bytes:
        data_end = _bytes_of(DataEnd(self._crc))
        summary_start = self._size + len(data_end)
        groups = [
            (Opcode.SCHEMA, _bytes_of(*self._schemas)),
            (Opcode.CHANNEL, _bytes_of(*self._channels)),
            (Opcode.STATISTICS, _bytes_of(self._statistics())),
            (Opcode.CHUNK_INDEX, b"".join(chunk.entry for chunk in self._chunks)),
            (Opcode.ATTACHMENT_INDEX, _bytes_of(*self._attachments)),
            (Opcode.METADATA_INDEX, _bytes_of(*self._metadata)),
        ]
        summary, offsets = b"", []
        for opcode, data in groups:
            if data:
                offsets.append(SummaryOffset(opcode, summary_start + len(summary), len(data)))
            summary += data
        offset_start = summary_start + len(summary)
        summary += _bytes_of(*offsets)
        footer_head = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
        crc = zlib.crc32(footer_head, zlib.crc32(summary))
        return data_end + summary + _bytes_of(Footer(summary_start, offset_start, crc)) + MAGIC

    def _statistics(self) -> Statistics:
        counts: dict[int, int] = {}
        for chunk in self._chunks:
            for channel, count in chunk.messages().items():
                counts[channel] = counts.get(channel, 0) + count
        spans = [chunk.span() for chunk in self._chunks]
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=counts,
            chunk_count=len(self._chunks),
            message_count=sum(counts.values()),
            message_end_time=max((end_ns for _, end_ns, _ in spans), default=0),
            message_start_time=min((begin_ns for begin_ns, _, _ in spans), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
