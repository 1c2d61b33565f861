"""Records of a log cut into the pieces of single ticks: what a replay does with every record.

Compiled, heads are read natively; interpreted, by `struct`, which costs less there.
"""

from __future__ import annotations

import struct
from struct import Struct
from typing import Final, final

from librt.strings import read_i16_le, read_i64_le
from mypy_extensions import i64

from bench.logs.replay.turn import Turn
from hil.log.packing import NATIVE
from hil.values import Value

HEAD_SIZE: Final = 31
"""Bytes of an MCAP Message record before its payload: opcode, length, channel, sequence, times."""

_head_of: Final = struct.Struct("<QH").unpack_from
_stamp_of: Final = struct.Struct("<q").unpack_from


@final
class Kinds(Value):
    """Channel numbers of today's topics that cut a log or are looked into.

    odd, before_odd: the topic that begins a piece unless the other one is before it
    """

    __slots__ = ("sensor", "timing", "received", "event", "command", "snapshot", "odd",
                 "before_odd")  # fmt: skip

    def __init__(
        self, sensor: i64, timing: i64, received: i64, event: i64, command: i64, snapshot: i64,
        odd: i64, before_odd: i64,
    ) -> None:  # fmt: skip
        self.sensor = sensor
        self.timing = timing
        self.received = received
        self.event = event
        self.command = command
        self.snapshot = snapshot
        self.odd = odd
        self.before_odd = before_odd


@final
class Piece:
    """The records of one tick, or of a batch that was not acted on.

    timing: where its last /timing begins, -1 without one; batches: what was received
    noted_ns: the time of the first batch received
    command, snapshot: first byte and end of those records, 0 where there is none
    """

    def __init__(self, start: i64) -> None:
        self.start = start
        self.end: i64 = start
        self.timing: i64 = -1
        self.command: i64 = 0
        self.command_end: i64 = 0
        self.snapshot: i64 = 0
        self.snapshot_end: i64 = 0
        self.has_snapshot = self.has_command = False
        self.noted_ns: i64 = 0
        self.batches: list[bytes] = []


def cut(
    data: bytes, numbers: dict[int, int], kinds: Kinds, batch_at: i64
) -> tuple[list[Piece], list[tuple[int, int]]]:
    """Cut where a tick begins; the last piece may go on in what comes after the data.

    The controller's begins with /sensor, or is a batch that was not acted on; the plant's begins
    with /sensor, or is a tick that was skipped and has only /truth and /timing. A log that goes on
    from another begins with a snapshot. A record that is cut off at the end is left out.

    Parameters: numbers : today's channel number of each of the log's; batch_at : where the bytes of
    a batch begin in its record
    Returns: the pieces; first byte and end of each event
    """
    pieces: list[Piece] = []
    events: list[tuple[int, int]] = []
    piece = Piece(0)
    last: i64 = -1
    offset: i64 = 0
    size: i64 = len(data)
    while offset + HEAD_SIZE <= size:
        end = _end_of(data, offset)
        if end > size:
            break
        kind: i64 = numbers[_channel_of(data, offset)]
        first = kind == kinds.snapshot and last == -1
        if kind == kinds.sensor or first or (kind == kinds.odd and last != kinds.before_odd):
            piece = Piece(offset)
            pieces.append(piece)
        if kind == kinds.event:
            events.append((offset, end))
        _enter(piece, data, kind, kinds, offset, end, batch_at)
        piece.end = offset = end
        last = kind
    return pieces, events


def _enter(
    piece: Piece, data: bytes, kind: i64, kinds: Kinds, offset: i64, end: i64, batch_at: i64
) -> None:
    """Take out of a record what a replay needs to know."""
    if kind == kinds.timing:
        piece.timing = offset
    elif kind == kinds.received:
        if not piece.batches:
            piece.noted_ns = _time_of(data, offset)
        piece.batches.append(data[offset + batch_at : end])
    elif kind == kinds.command:
        piece.command, piece.command_end, piece.has_command = offset, end, True
    elif kind == kinds.snapshot:
        piece.snapshot, piece.snapshot_end, piece.has_snapshot = offset, end, True


@final
class Joiner:
    """Puts pieces together to turns.

    Ticks of the controller that were missed belong to the turn of the batch that showed the gap;
    ticks of the plant that were skipped, to the turn that came too late for them.
    """

    def __init__(self, timing: Struct, payload_at: i64, *, is_plant: bool) -> None:
        self._timing = timing
        self._payload_at = payload_at
        self._is_plant = is_plant
        self._earlier = b""
        self._dones: list[int] = []
        self._first: i64 = -1

    def turn(
        self, data: bytes, piece: Piece, command: tuple[str, bytes] | None,
        snapshot: tuple[int, str] | None,
    ) -> Turn | None:  # fmt: skip
        """The turn that a piece ends, None when it goes on with the next one."""
        own = data[piece.start : piece.end]
        batches: tuple[bytes, ...] = tuple(piece.batches)
        if piece.timing < 0:
            noted_ns: tuple[int, ...] = (piece.noted_ns,)
            return Turn(-1, -1, 0, noted_ns, -1, batches, None, snapshot, own)
        times: tuple[int, int, int, int, int, int, int] = self._timing.unpack_from(
            data, piece.timing + self._payload_at
        )
        tick, _, scheduled_ns, woke_ns, done_ns, used, missed = times
        first: i64 = tick if self._first < 0 else self._first
        if missed:
            self._first = first
            self._earlier += own
            self._dones.append(done_ns)
            return None
        instants: tuple[int, ...] = (woke_ns, done_ns)
        if self._first >= 0:
            own = self._earlier + own
            if not self._is_plant:
                instants = (woke_ns, *self._dones, done_ns)
            self._first, self._earlier, self._dones = -1, b"", []
        return Turn(first, tick, scheduled_ns, instants, used, batches, command, snapshot, own)


def _end_of(data: bytes, offset: i64) -> i64:
    """Where a record ends."""
    if NATIVE:
        return offset + 9 + read_i64_le(data, offset + 1)
    length: int = _head_of(data, offset + 1)[0]
    return offset + 9 + length


def _time_of(data: bytes, offset: i64) -> i64:
    """The log time of a record [ns]."""
    if NATIVE:
        return read_i64_le(data, offset + 15)
    t_ns: int = _stamp_of(data, offset + 15)[0]
    return t_ns


def _channel_of(data: bytes, offset: i64) -> int:
    """The channel number of a record."""
    if NATIVE:
        return int(read_i16_le(data, offset + 9))
    channel: int = _head_of(data, offset + 1)[1]
    return channel
