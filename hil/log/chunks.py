"""Chunks of an MCAP file: decompression, checks, and records gathered by their offsets."""

from __future__ import annotations

import zlib
from io import BytesIO
from typing import IO, Any

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk
from numpy.typing import NDArray

from hil.log.records import CDR_LE, MESSAGE, PAYLOAD_OFFSET
from hil.log.summary import ChunkPlace, read_at

MAX_CHUNK_BYTES = 1 << 30
_INDEX_HEAD = 15  # opcode, length, channel, bytes of the entries
_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
        ("cdr", "<u4"),
    ]
)
_CDR = int.from_bytes(CDR_LE, "little")


def chunk_bytes(file: IO[bytes], place: ChunkPlace) -> bytes:
    """Return the records of a chunk, decompressed and checked against its CRC.

    Raises: ValueError when the chunk is not what its header and index say
    """
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


def message_offsets(file: IO[bytes], place: ChunkPlace, channel: int) -> NDArray[np.int64]:
    """Return where the messages of a channel lie in their chunk, in the order of the file."""
    file.seek(place.indexes[channel])
    head = file.read(_INDEX_HEAD)
    size = int.from_bytes(head[11:15], "little")
    if size > place.index_bytes or size % 16:
        raise ValueError(f"a message index of {size} bytes")
    return np.frombuffer(file.read(size), dtype="<i8")[1::2]


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
    item = np.dtype((np.void, dtype.itemsize))
    windows = np.ndarray((places,), dtype=item, buffer=chunk, offset=skip, strides=(1,))
    return windows[offsets].view(dtype)


def check_heads(chunk: bytes, offsets: NDArray[np.int64], channel: int) -> NDArray[np.int64]:
    """Return the payload sizes of the messages, without their encapsulation bytes.

    Raises: ValueError when an offset leads to no message of the channel, or to other bytes than
    little-endian CDR
    """
    heads = gather(chunk, offsets, 0, _HEAD)
    if (heads["opcode"] != MESSAGE).any() or (heads["channel"] != channel).any():
        raise ValueError("a message index that does not point to its messages")
    if (heads["cdr"] != _CDR).any():
        raise ValueError("messages that are not little-endian CDR")
    sizes: NDArray[np.int64] = heads["length"].astype(np.int64) + 9 - PAYLOAD_OFFSET
    if sizes.min() < 0 or (offsets + PAYLOAD_OFFSET + sizes).max() > len(chunk):
        raise ValueError("messages that reach beyond their chunk")
    return sizes
