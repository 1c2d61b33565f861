"""Chunks of an MCAP file: decompression, checks, and records gathered by their offsets."""

from __future__ import annotations

import zlib
from io import BytesIO
from typing import IO, Any, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk
from numpy.typing import NDArray

from hil.log.records import MESSAGE, MESSAGE_HEAD
from hil.log.summary import INDEX_HEAD, ChunkPlace, read_at, records

MAX_CHUNK_BYTES = 1 << 30
_LENGTHS = np.uint64((1 << 62) - 1)
_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)


class Contents(NamedTuple):
    """The messages of a chunk in the order of the file, and what it describes besides.

    Parameters: channels, times, offsets : arrays of one length: number of the channel, log time
        [ns], place of the record; described : (opcode, body) of schemas and channels
    """

    channels: NDArray[np.uint16]
    times: NDArray[np.uint64]
    offsets: NDArray[np.int64]
    described: list[tuple[int, bytes]]

    def counts(self) -> dict[int, int]:
        """Return the messages of each channel."""
        numbers, counts = np.unique(self.channels, return_counts=True)
        return dict(zip(numbers.tolist(), counts.tolist(), strict=True))


def contents(data: bytes) -> Contents:
    """Walk through the records of a chunk.

    Raises: ValueError when one is cut off, or a message has no head
    """
    channels, times, offsets, described = [], [], [], []
    offset = 0
    for opcode, body in records(data):
        if opcode == MESSAGE:
            if len(body) < MESSAGE_HEAD.size - 9:
                raise ValueError("a message that is cut off")
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(data, offset)
            channels.append(channel)
            times.append(log_time)
            offsets.append(offset)
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            described.append((opcode, body))
        offset += 9 + len(body)
    return Contents(
        np.array(channels, np.uint16),
        np.array(times, np.uint64),
        np.array(offsets, np.int64),
        described,
    )


def indexed_contents(data: bytes, offsets: NDArray[np.int64]) -> Contents:
    """Return what `contents` does, without the walk where messages lie end to end as indexed.

    Raises: ValueError as `contents`
    """
    offsets = np.sort(offsets)
    if len(offsets) and offsets[0] == 0 and offsets[-1] <= len(data) - _HEAD.itemsize:
        found = gather(data, offsets, 0, _HEAD)
        ends = offsets + 9 + (found["length"] & _LENGTHS).astype(np.int64)
        wanted = np.append(offsets[1:], len(data))
        whole = (found["opcode"] == MESSAGE) & (ends == wanted)
        if whole.all() and (ends - offsets >= _HEAD.itemsize).all():
            return Contents(found["channel"], found["log_time"], offsets, [])
    return contents(data)


def chunk_bytes(file: IO[bytes], place: ChunkPlace) -> bytes:
    """Return the records of a chunk, decompressed and checked against its CRC.

    Raises: ValueError when the chunk is not what its header and index say
    """
    if place.bare:
        file.seek(place.offset)
        return file.read(place.length)
    return unpacked(read_at(file, place.offset, Opcode.CHUNK))


def unpacked(body: bytes) -> bytes:
    """Return the records in the body of a Chunk record; ValueError as above."""
    chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes, at most {MAX_CHUNK_BYTES}")
    data = _decompress(chunk)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"{len(data)} bytes, {chunk.uncompressed_size} expected")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("the checksum (CRC) does not match")
    return data


def _decompress(chunk: Chunk) -> bytes:
    data: bytes
    if chunk.compression == "zstd":
        claimed = zstandard.get_frame_parameters(chunk.data).content_size
        if claimed not in (zstandard.CONTENTSIZE_UNKNOWN, chunk.uncompressed_size):
            raise ValueError(f"{claimed} bytes, {chunk.uncompressed_size} expected")
        data = zstandard.decompress(chunk.data, chunk.uncompressed_size)
    elif chunk.compression == "lz4":
        data = _expand(chunk)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"compression {chunk.compression!r}: accepted are zstd, lz4 and none")
    return data


def _expand(chunk: Chunk) -> bytes:
    """Decompress lz4, which other writers use, to no more than the size that is told."""
    import lz4.frame  # noqa: PLC0415  # comes with mcap; our own files never need it

    decompressor = lz4.frame.LZ4FrameDecompressor()
    try:
        data: bytes = decompressor.decompress(chunk.data, chunk.uncompressed_size + 1)
    except EOFError:
        raise ValueError("the compressed data are cut off") from None
    return data


def message_offsets(
    file: IO[bytes], place: ChunkPlace, channels: tuple[int, ...], data: bytes
) -> NDArray[np.int64]:
    """Return where the messages of some channels lie in their chunk, in the order of the file.

    Raises: ValueError when an index does not lead to messages of its channel and time
    """
    known = [number for number in channels if number in place.indexes]
    if any(place.indexes[number] == 0 for number in known):
        found = contents(data)
        return found.offsets[np.isin(found.channels, known)]
    indexes = [_checked(data, number, *message_index(file, place, number)) for number in known]
    return indexes[0] if len(indexes) == 1 else np.sort(np.concatenate(indexes))


def message_index(
    file: IO[bytes], place: ChunkPlace, channel: int
) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """Return log times and offsets as the index behind a chunk has them.

    Raises: ValueError when there is no index of that channel
    """
    file.seek(place.indexes[channel])
    head = file.read(INDEX_HEAD)
    opcode, number = head[:1], int.from_bytes(head[9:11], "little")
    size = int.from_bytes(head[11:15], "little")
    if opcode != bytes([Opcode.MESSAGE_INDEX]) or number != channel:
        raise ValueError(f"no message index of channel {channel}")
    if size > place.index_bytes or size % 16:
        raise ValueError(f"a message index of {size} bytes")
    return index_entries(file.read(size))


def index_entries(data: bytes) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """Return log times and offsets of the entries of a message index."""
    entries = np.frombuffer(data, _ENTRY)
    return entries["log_time"], entries["offset"].astype(np.int64)


def _checked(
    data: bytes, channel: int, times: NDArray[np.uint64], offsets: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the offsets, each leading to another message of the channel and of its time."""
    if not len(offsets):
        return offsets
    found = heads(data, offsets)
    if (found["channel"] != channel).any() or (found["log_time"] != times).any():
        raise ValueError("a message index that does not point to its messages")
    if len(np.unique(offsets)) < len(offsets):
        raise ValueError("a message index that names a message twice")
    return offsets


def gather(
    chunk: bytes, offsets: NDArray[np.int64], skip: int, dtype: np.dtype[Any]
) -> NDArray[Any]:
    """Return the `dtype` items that begin `skip` bytes behind each offset.

    The chunk is seen as an array that has an item at every byte, so that numpy copies the wanted
    ones in one go, however the records of other topics lie between them.
    """
    places = len(chunk) - skip - dtype.itemsize + 1
    if offsets.min() < 0 or offsets.max() >= places:
        raise ValueError("a message index that points outside its chunk")
    if not dtype.itemsize:
        return np.zeros(len(offsets), dtype)
    item = np.dtype((np.void, dtype.itemsize))
    windows = np.ndarray((places,), dtype=item, buffer=chunk, offset=skip, strides=(1,))
    return windows[offsets].view(dtype)


def heads(chunk: bytes, offsets: NDArray[np.int64]) -> NDArray[Any]:
    """Return the heads of messages: opcode, length, channel, sequence, log_time, publish_time.

    Raises: ValueError when an offset leads to no message
    """
    found = gather(chunk, offsets, 0, _HEAD)
    lengths = found["length"].astype(np.int64)
    if (found["opcode"] != MESSAGE).any() or lengths.min() < _HEAD.itemsize - 9:
        raise ValueError("a message index that does not point to its messages")
    if lengths.max() > len(chunk) or (offsets + 9 + lengths).max() > len(chunk):
        raise ValueError("messages that reach beyond their chunk")
    return found
