"""Where the CAN link gets its frames from: a port with one adapter a kind of bus.

Frames cross it as (identifier with Linux's flags, little-endian data word, time of arrival [ns]).
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping
from typing import Final, NamedTuple, Protocol

from drivers.can.errors import describe
from drivers.can.virtual.records import (
    ERROR,
    REMOTE,
    Frame,
    pack_batch,
    pack_frame,
    unpack_frames,
)
from drivers.can.virtual.segment import Segment
from drivers.can.virtual.transmitter import Medium, Transmitter, open_wire
from hil.errors import ConfigError, LinkError
from hil.wire.codec import iter_frames

Received = tuple[int, int, int]
Notice = tuple[str, str]

_MAX_NOTICES: Final = 64


class Wanted(NamedTuple):
    """Which frames a process wants: data of these identifiers, and a remote frame of that one."""

    data: tuple[int, ...]
    remote: int


class HeadPlace(NamedTuple):
    """The frame that opens a tick, and where it tells how many frames the tick has."""

    can_id: int
    shift: int
    mask: int


class FramePort(Protocol):
    """A node of a bus, as the link uses it."""

    name: str
    stamps: bool
    """Whether the frames' times are those of this machine's clock."""

    def send(self, batch: bytes, deadline_ns: int, /) -> None:
        """Send the frames of a batch in their order; what does not go out by then is counted.

        Raises: LinkError when the bus is gone for good
        """

    def ask(self, can_id: int, /) -> None:
        """Send a remote frame."""

    def receive(self) -> list[Received]:
        """Return frames that have come, oldest first: all of them, or to the end of a tick."""

    def settle(self) -> None:
        """Return when nodes that joined by now are reached; only before the loop runs."""

    def notices(self) -> list[Notice]:
        """Return (code, text) of what the bus reported since the last time."""

    def counters(self) -> Mapping[str, int]:
        """Return what was counted."""

    def close(self) -> None:
        """Leave the bus."""


class Notices:
    """What a bus reported and nobody has read yet; of a flood only the first."""

    __slots__ = ("_waiting", "count")

    def __init__(self) -> None:
        self.count = 0
        self._waiting: list[Notice] = []

    def add(self, can_id: int, data: bytes) -> None:
        """Take an error frame."""
        self.count += 1
        if len(self._waiting) < _MAX_NOTICES:
            self._waiting.append(describe(can_id, data))

    def take(self) -> list[Notice]:
        """Return what is new."""
        if not self._waiting:
            return []
        taken, self._waiting = self._waiting, []
        return taken


class ZenohFrames:
    """A node of the virtual bus, without python-can in between.

    Parameters: medium : rates and errors of a bus with timing, None without
        patience_us : how long a send may wait for a node that does not keep up
    """

    def __init__(
        self, channel: str, wanted: Wanted, medium: Medium | None, patience_us: int
    ) -> None:
        self.name = f"zenoh:{channel}"
        self.stamps = True
        self._segment = Segment(channel, patience_us=patience_us)
        self._wanted = {*wanted.data, wanted.remote | REMOTE}
        self._notices = Notices()
        self._transmitter: Transmitter | None = None
        self._full = 0
        self._closed = False
        if medium is not None:
            try:
                wire = open_wire(self._segment, medium.bitrate_bit_s)
            except ConfigError:
                self._segment.close()
                raise
            self._transmitter = Transmitter(wire, medium, self._publish, self._report)

    def _publish(self, frame: Frame) -> None:
        with contextlib.suppress(LinkError):  # closing while a frame is on the wire
            self._segment.publish(pack_frame(frame))

    def _report(self, frame: Frame) -> None:
        self._notices.add(frame.can_id, frame.data)

    def send(self, batch: bytes, _deadline_ns: int, /) -> None:
        """Publish a batch at once, or let its frames wait for the wire.

        Raises: LinkError when the bus is closed
        """
        t_ns = time.time_ns()
        if self._closed:
            raise LinkError(f"{self.name}: cannot send: the bus is closed")
        if self._transmitter is None:
            self._segment.publish(pack_batch(iter_frames(batch), t_ns))
            return
        for can_id, word in iter_frames(batch):
            frame = Frame(can_id, 0, 8, word.to_bytes(8, "little"), t_ns)
            if self._transmitter.is_off or not self._transmitter.put(frame, 0.0):
                self._full += 1

    def ask(self, can_id: int, /) -> None:
        """Send a remote frame."""
        self._segment.publish(pack_frame(Frame(can_id | REMOTE, 0, 8, b"", time.time_ns())))

    def receive(self) -> list[Received]:
        """Return all frames that have come, oldest first."""
        received: list[Received] = []
        while (payload := self._segment.poll()) is not None:
            for can_id, flags, length, data, t_ns in unpack_frames(payload):
                if can_id & ERROR:
                    self._notices.add(can_id, data)
                elif can_id in self._wanted and length == 8 and not flags:
                    received.append((can_id, int.from_bytes(data, "little"), t_ns))
        return received

    def settle(self) -> None:
        """Return when nodes that joined by now are reached."""
        self._segment.greet()

    def notices(self) -> list[Notice]:
        """Return what the bus reported since the last time."""
        return self._notices.take()

    def counters(self) -> Mapping[str, int]:
        """Return error frames, overruns of the receive queue and frames that found no room."""
        return {
            "bus_errors": self._notices.count,
            "overruns": self._segment.overruns,
            "malformed": self._segment.malformed,
            "send_full": self._full,
        }

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        self._closed = True
        if self._transmitter is not None:
            self._transmitter.stop()
        self._segment.close()
