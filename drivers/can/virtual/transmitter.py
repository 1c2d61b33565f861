"""The transmit side of a timed bus: frames wait for the wire, may meet errors, and go out late.

Error counting is that of ISO 11898-1: an error of one's own frame adds 8, a success takes 1 off;
from 128 on the node is error passive, from 256 on it is off the bus.
"""

from __future__ import annotations

import random
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

from drivers.can.errors import BUS_ERROR, BUS_OFF, COUNTERS, ERROR_FLAG, PROTOCOL, RESTARTED
from drivers.can.virtual.directory import locked
from drivers.can.virtual.records import EXTENDED, FD, REMOTE, Frame
from drivers.can.virtual.segment import Segment
from drivers.can.virtual.wire import SharedWire, Waiting, arbitration_key, frame_ns

ERROR_PASSIVE: Final = 128
BUS_OFF_LIMIT: Final = 256
QUEUE_FRAMES: Final = 32
_NAP_S: Final = 0.5
_SHORTEST_S: Final = 20e-6
_ERROR_FRAME_BITS: Final = 20
_ID_MASK: Final = 0x1FFFFFFF


def open_wire(segment: Segment, bitrate_bit_s: int) -> SharedWire:
    """Return the wire that the nodes of a segment share.

    Raises: ConfigError when the channel runs at another bit rate
    """
    return SharedWire(
        segment.shared, lambda: locked(segment.lock), bitrate_bit_s,
        lambda: segment.nodes() == 1,
    )  # fmt: skip


class Medium(NamedTuple):
    """What a timed bus is like: its rates, and how often a frame of this node is hit by an error.

    restart_s: time after which a node that went off the bus comes back, 0 never by itself
    """

    bitrate_bit_s: int
    data_bitrate_bit_s: int
    error_rate: float
    seed: int
    restart_s: float


class Entry(NamedTuple):
    """A frame that waits for the wire: its slot there, and whether an error will hit it."""

    frame: Frame
    slot: int
    hit: bool


def error_frame(kind: int, errors: int, t_ns: int) -> Frame:
    """Return an error frame as the kernel would make it."""
    data = bytes((0, 0, 0, 0, 0, 0, min(errors, 255), 0))
    return Frame(ERROR_FLAG | COUNTERS | kind, 0, 8, data, t_ns)


class Transmitter:
    """Sends queued frames one by one when the wire is theirs.

    Parameters: publish : hands a frame to all other nodes; echo : to this node itself
    """

    def __init__(
        self,
        wire: SharedWire,
        medium: Medium,
        publish: Callable[[Frame], None],
        echo: Callable[[Frame], None],
    ) -> None:
        self.errors = 0
        self.off_until_s = 0.0
        self._wire = wire
        self._medium = medium
        self._publish = publish
        self._echo = echo
        self._random = random.Random(medium.seed)
        self._queue: deque[Frame] = deque()
        self._changed = threading.Condition()
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="CAN wire", daemon=True)
        self._thread.start()

    @property
    def is_off(self) -> bool:
        """Whether the node is off the bus."""
        return self.off_until_s > 0.0

    def put(self, frame: Frame, timeout_s: float) -> bool:
        """Queue a frame; False when there is no room within the time."""
        with self._changed:
            room = self._changed.wait_for(lambda: len(self._queue) < QUEUE_FRAMES, timeout_s)
            if room:
                self._queue.append(frame)
                self._changed.notify_all()
            return room

    def flush(self) -> None:
        """Drop what has not begun to be sent."""
        with self._changed:
            self._queue.clear()
            self._changed.notify_all()

    def leave(self) -> None:
        """Go off the bus: nothing is sent until `restart`, or for the medium's restart time."""
        self.flush()
        restart_s = self._medium.restart_s
        self.off_until_s = time.monotonic() + restart_s if restart_s else float("inf")
        self._echo(error_frame(BUS_OFF, self.errors, time.time_ns()))

    def restart(self) -> None:
        """Come back to the bus with clean counters."""
        self.errors = 0
        if self.is_off:
            self.off_until_s = 0.0
            self._echo(error_frame(RESTARTED, 0, time.time_ns()))

    def stop(self) -> None:
        """End the thread; a frame on the wire is not waited for."""
        with self._changed:
            self._stopped = True
            self._queue.clear()
            self._changed.notify_all()
        self._thread.join(2.0)

    def _run(self) -> None:
        entry: Entry | None = None
        while not self._stopped:
            if self.is_off and time.monotonic() >= self.off_until_s:
                self.restart()
            if entry is None:
                entry = self._load(time.monotonic_ns(), _NAP_S)
            elif (end_ns := self._granted(entry.slot)) is not None:
                entry = self._finish(entry, end_ns)
        if entry is not None:
            self._wire.abandon(entry.slot)

    def _load(self, ready_ns: int, timeout_s: float) -> Entry | None:
        """Let the next queued frame wait for the wire, as soon as there is one."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._stopped, timeout_s)
            if not self._queue or self._stopped:
                return None
            frame = self._queue.popleft()
            self._changed.notify_all()
        return self._enter(frame, max(ready_ns, time.monotonic_ns()) if timeout_s else ready_ns)

    def _enter(self, frame: Frame, ready_ns: int) -> Entry | None:
        """Put a frame into the table of those that wait; an error may be in store for it."""
        hit = self._random.random() < self._medium.error_rate
        waiting = self._waiting(frame)._replace(ready_ns=ready_ns)
        if hit:
            extra_ns = round(1e9 * _ERROR_FRAME_BITS / self._medium.bitrate_bit_s)
            waiting = waiting._replace(duration_ns=waiting.duration_ns + extra_ns)
        while (slot := self._wire.enter(waiting, time.monotonic_ns())) is None:
            time.sleep(_SHORTEST_S)
            if self._stopped:
                return None
        return Entry(frame, slot, hit)

    def _granted(self, slot: int) -> int | None:
        """Wait a while for the wire; returns the frame's end once it has begun [ns]."""
        sent, at_ns = self._wire.look(slot, time.monotonic_ns())
        if sent:
            return at_ns
        time.sleep(min(max((at_ns - time.monotonic_ns()) * 1e-9, _SHORTEST_S), _NAP_S))
        return None

    def _finish(self, entry: Entry, end_ns: int) -> Entry | None:
        """See a frame to its end; returns the entry that contends from that end on, if any."""
        following = self._enter(entry.frame, end_ns) if entry.hit else None
        while (left_s := (end_ns - time.monotonic_ns()) * 1e-9) > 0.0 and not self._stopped:
            if following is not None:
                time.sleep(min(left_s, _NAP_S))
            elif self._await_frame(left_s):
                following = self._load(end_ns, 0.0)
        t_ns = time.time_ns() - (time.monotonic_ns() - end_ns)
        if not entry.hit:
            self.errors = max(self.errors - 1, 0)
            self._publish(entry.frame._replace(t_ns=t_ns))
        elif self._is_lost(t_ns) and following is not None:
            self._wire.abandon(following.slot)
            return None
        return following

    def _await_frame(self, timeout_s: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._queue), timeout_s)

    def _is_lost(self, t_ns: int) -> bool:
        """Count an error of one's own frame, which all nodes have seen; too many end it all."""
        self.errors += 8
        error = error_frame(PROTOCOL | BUS_ERROR, self.errors, t_ns)
        self._publish(error)
        self._echo(error)
        if self.errors >= BUS_OFF_LIMIT:
            self.leave()
        return self.is_off

    def _waiting(self, frame: Frame) -> Waiting:
        can_id = frame.can_id & _ID_MASK
        extended, remote = bool(frame.can_id & EXTENDED), bool(frame.can_id & REMOTE)
        fast = self._medium.data_bitrate_bit_s if frame.flags & FD else 0
        duration_ns = frame_ns(
            can_id, frame.data, frame.length, self._medium.bitrate_bit_s,
            extended=extended, remote=remote, data_bitrate_bit_s=fast,
        )  # fmt: skip
        return Waiting(arbitration_key(can_id, extended=extended, remote=remote), 0, duration_ns)
