"""A wire that takes its time: one frame after the other, the lowest identifier first.

All nodes of a channel share a small table of the frames that wait. Whoever finds the wire free
lets the arbitration be decided for all of them, on the wire's own timeline: a frame begins when
the one before it ends, however late the processes wake up.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Final, NamedTuple

from hil.errors import ConfigError
from hil.wire.busload import classic_bits, fd_bits

_STANDARD_SHIFT: Final = 18
_OFFSET: Final = 64  # the first bytes of the shared memory are the segment's
_HEAD: Final = struct.Struct("<QQ")  # bit rate, end of the frame on the wire [ns]
_SLOT: Final = struct.Struct("<QQQQ")  # state and key, ready [ns], duration [ns], end [ns]
SLOTS: Final = 64
_FORGET_NS: Final = 1_000_000_000
_FREE, _WAITING, _GRANTED = 0, 1, 2


class Waiting(NamedTuple):
    """A frame before arbitration: `key` is lowest for the frame that wins."""

    key: int
    ready_ns: int
    duration_ns: int


def arbitration_key(can_id: int, *, extended: bool, remote: bool) -> int:
    """Return the bits of the arbitration field as a number: the lowest is sent first.

    A standard frame beats the extended one with the same base, a data frame its remote frame.
    """
    if not extended:
        return (can_id & 0x7FF) << 21 | remote << 20
    base, more = can_id >> _STANDARD_SHIFT & 0x7FF, can_id & 0x3FFFF
    return base << 21 | 1 << 20 | 1 << 19 | more << 1 | remote


def frame_ns(
    can_id: int,
    data: bytes,
    length: int,
    bitrate_bit_s: int,
    *,
    extended: bool = False,
    remote: bool = False,
    data_bitrate_bit_s: int = 0,
) -> int:
    """Return how long a frame and its gap hold the wire [ns].

    Parameters: data_bitrate_bit_s : rate of the data phase of an FD frame, 0 for a classic frame
    """
    if data_bitrate_bit_s:
        nominal, fast = fd_bits(can_id, length, data, extended=extended)
        return round(1e9 * (nominal / bitrate_bit_s + fast / data_bitrate_bit_s))
    bits = classic_bits(can_id, data, extended=extended, remote=length if remote else -1)
    return round(1e9 * bits / bitrate_bit_s)


def decide(waiting: dict[int, Waiting], free_ns: int, now_ns: int) -> tuple[dict[int, int], int]:
    """Let frames onto the wire until it is busy beyond now.

    The wire is taken at t = max(free, earliest ready) by the lowest key among those ready by t.

    Parameters: waiting : by slot; free_ns : end of the last frame [ns]
    Returns: end of each frame that was let on, by slot [ns], and the end of the last one
    """
    left = dict(waiting)
    ends: dict[int, int] = {}
    while left and free_ns <= now_ns:
        start_ns = max(free_ns, min(frame.ready_ns for frame in left.values()))
        if start_ns > now_ns:
            break
        slot = min(
            (slot for slot, frame in left.items() if frame.ready_ns <= start_ns),
            key=lambda slot: (left[slot].key, left[slot].ready_ns, slot),
        )
        free_ns = ends[slot] = start_ns + left.pop(slot).duration_ns
    return ends, free_ns


class SharedWire:
    """The wire of one channel, in memory that its nodes share and under their common lock.

    Raises: ConfigError when the channel runs at another bit rate by now
    """

    def __init__(
        self,
        memory: mmap.mmap,
        locked: Callable[[], AbstractContextManager[None]],
        bitrate_bit_s: int,
        alone: Callable[[], bool],
    ) -> None:
        self._memory = memory
        self._locked = locked
        with locked():
            running, free_ns = _HEAD.unpack_from(memory, _OFFSET)
            if running not in {0, bitrate_bit_s} and not alone():
                raise ConfigError(
                    f"CAN bit rate {bitrate_bit_s}: the channel runs at {running} bit/s"
                )
            _HEAD.pack_into(memory, _OFFSET, bitrate_bit_s, free_ns)

    def _place(self, slot: int) -> int:
        return _OFFSET + _HEAD.size + slot * _SLOT.size

    def enter(self, frame: Waiting, now_ns: int) -> int | None:
        """Let a frame wait for the wire; returns its slot, None when too many wait already."""
        with self._locked():
            for slot in range(SLOTS):
                state, _, _, end_ns = _SLOT.unpack_from(self._memory, self._place(slot))
                forgotten = state & 3 == _GRANTED and end_ns + _FORGET_NS < now_ns
                if state == _FREE or forgotten:
                    entry = (frame.key << 2 | _WAITING, frame.ready_ns, frame.duration_ns, 0)
                    _SLOT.pack_into(self._memory, self._place(slot), *entry)
                    return slot
        return None

    def look(self, slot: int, now_ns: int) -> tuple[bool, int]:
        """Decide what can be decided; returns (sent, its end) or (not yet, when to look again)."""
        with self._locked():
            free_ns = self._decide(now_ns)
            state, ready_ns, _, end_ns = _SLOT.unpack_from(self._memory, self._place(slot))
            if state & 3 == _GRANTED:
                _SLOT.pack_into(self._memory, self._place(slot), _FREE, 0, 0, 0)
                return True, end_ns
            return False, max(free_ns, ready_ns)

    def _decide(self, now_ns: int) -> int:
        """Run the arbitration over the table; returns when the wire is free."""
        bitrate, free_ns = _HEAD.unpack_from(self._memory, _OFFSET)
        waiting = {}
        for slot in range(SLOTS):
            state, ready_ns, duration_ns, _ = _SLOT.unpack_from(self._memory, self._place(slot))
            if state & 3 == _WAITING:
                waiting[slot] = Waiting(state >> 2, ready_ns, duration_ns)
        ends, free_ns = decide(waiting, free_ns, now_ns)
        for slot, end_ns in ends.items():
            frame = waiting[slot]
            granted = (frame.key << 2 | _GRANTED, frame.ready_ns, frame.duration_ns, end_ns)
            _SLOT.pack_into(self._memory, self._place(slot), *granted)
        _HEAD.pack_into(self._memory, _OFFSET, bitrate, free_ns)
        return int(free_ns)

    def abandon(self, slot: int) -> None:
        """Take a waiting frame back."""
        with self._locked():
            _SLOT.pack_into(self._memory, self._place(slot), _FREE, 0, 0, 0)
