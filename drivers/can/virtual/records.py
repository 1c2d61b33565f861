"""Frames as the virtual bus carries them: a head of 16 bytes each, then the data.

One message of the bus is a head that names its sender and counts its messages, so that what a
full queue dropped can be told, and any number of frames.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

HEAD: Final = struct.Struct("<4sQI")
MAGIC: Final = b"HCN1"
_FRAME: Final = struct.Struct("<IBBHQ")

EXTENDED, REMOTE, ERROR = 1 << 31, 1 << 30, 1 << 29
"""Flags beside the identifier, as in Linux."""
FD, BRS, ESI = 1, 2, 4

_MAX_CLASSIC: Final = 8
_MAX_FD: Final = 64


class Frame(NamedTuple):
    """One frame: identifier with its flags, FD flags, length code or bytes, data, time [ns]."""

    can_id: int
    flags: int
    length: int
    data: bytes
    t_ns: int


def pack_frame(frame: Frame) -> bytes:
    """Return one frame with its head."""
    can_id, flags, length, data, t_ns = frame
    return _FRAME.pack(can_id, flags, length, 0, t_ns) + data


def unpack_frames(payload: bytes, start: int = HEAD.size) -> Iterator[Frame]:
    """Yield the frames of one message of the bus; ends at the first that is malformed."""
    place, end = start, len(payload)
    while place + _FRAME.size <= end:
        can_id, flags, length, _, t_ns = _FRAME.unpack_from(payload, place)
        place += _FRAME.size
        most = _MAX_FD if flags & FD else _MAX_CLASSIC
        size = 0 if can_id & REMOTE else length
        if length > most or place + size > end:
            return
        yield Frame(can_id, flags, length, payload[place : place + size], t_ns)
        place += size


def pack_batch(frames: Iterable[tuple[int, int]], t_ns: int) -> bytes:
    """Return classic data frames of 8 bytes, (identifier, little-endian word), all of one time."""
    pack = _FRAME.pack
    return b"".join(
        pack(can_id, 0, _MAX_CLASSIC, 0, t_ns) + word.to_bytes(8, "little")
        for can_id, word in frames
    )
