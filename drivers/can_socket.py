"""SocketCAN without detours: one raw socket, drained a tick at a time, filtered by the kernel.

python-can's own class reads a frame a call, keeps time in floats and gives up on a full queue.
"""

from __future__ import annotations

import errno
import socket
import struct
import time
from collections.abc import Callable, Mapping
from typing import Final

from drivers.can_errors import BUS_OFF, ERROR_FLAG
from drivers.can_frames import Notice, Notices, Received, Wanted
from drivers.can_records import EXTENDED, REMOTE
from hil.codec import iter_frames
from hil.errors import ConfigError, LinkError

FRAME: Final = struct.Struct("<IB3xQ")
"""A classic frame of a little-endian kernel; its eight data bytes are read as one word."""

_AF_CAN, _CAN_RAW, _SOL_CAN_RAW = 29, 1, 101
_RAW_FILTER, _RAW_ERR_FILTER = 1, 2
_SO_TIMESTAMPNS: Final = 35
_STAMP: Final = struct.Struct("=qq")
_FILTER: Final = struct.Struct("=II")
_STANDARD: Final = 0x7FF
_ALL_ERRORS: Final = 0x1FFFFFFF
_FRAME_BYTES: Final = 16
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(_STAMP.size)
_MOST_AT_ONCE: Final = 512
_RECEIVE_BYTES: Final = 1 << 20
_RETRY_S: Final = 50e-6
_ASK_NS: Final = 50_000_000


def filters(wanted: Wanted) -> bytes:
    """Return the kernel's filters: data frames of the peer, and the remote frame that asks."""
    mask = _STANDARD | EXTENDED | REMOTE
    return b"".join(_FILTER.pack(can_id, mask) for can_id in wanted.data) + _FILTER.pack(
        wanted.remote | REMOTE, mask
    )


def open_socket(channel: str, wanted: Wanted) -> socket.socket:
    """Return a raw socket on an interface, not blocking, with filters, errors and time stamps.

    Raises: ConfigError when the kernel has no CAN or no such interface
    """
    try:
        raw = socket.socket(_AF_CAN, socket.SOCK_RAW, _CAN_RAW)
    except OSError as error:
        raise ConfigError(
            f"--bus socketcan:{channel}: {error.strerror}; this kernel has no SocketCAN,"
            " accepted zenoh:can0"
        ) from None
    try:
        raw.setsockopt(_SOL_CAN_RAW, _RAW_FILTER, filters(wanted))
        raw.setsockopt(_SOL_CAN_RAW, _RAW_ERR_FILTER, _ALL_ERRORS)
        raw.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BYTES)
        raw.bind((channel,))
        raw.setblocking(False)
    except OSError as error:
        raw.close()
        raise ConfigError(f"--bus socketcan:{channel}: {error.strerror}") from None
    return raw


class SocketFrames:
    """A node of a SocketCAN interface.

    Parameters: raw : a socket as `open_socket` gives it
    """

    def __init__(self, raw: socket.socket, channel: str, sleep: Callable[[float], None]) -> None:
        self.name = f"socketcan:{channel}"
        self.stamps = True
        self._raw = raw
        self._sleep = sleep
        self._notices = Notices()
        self._retries = self._full = self._errors = self._bus_off = 0
        self._closed = False

    @property
    def descriptor(self) -> int:
        """What to wait on for frames."""
        return self._raw.fileno()

    def send(self, batch: bytes, deadline_ns: int, /) -> None:
        """Write frame by frame; while the queue is full try again until the deadline.

        Raises: LinkError when the interface is gone
        """
        if self._closed:
            raise LinkError(f"{self.name}: cannot send: the bus is closed")
        for can_id, word in iter_frames(batch):
            self._write(FRAME.pack(can_id, 8, word), deadline_ns)

    def _write(self, frame: bytes, deadline_ns: int) -> None:
        """Write one frame; one that does not go out is counted, not queued for later."""
        while True:
            try:
                self._raw.send(frame)
            except OSError as error:
                if error.errno in {errno.ENOBUFS, errno.EAGAIN}:
                    if time.monotonic_ns() < deadline_ns:
                        self._retries += 1
                        self._sleep(_RETRY_S)
                        continue
                    self._full += 1
                    return
                self._fail(error, "send")
            return

    def _fail(self, error: OSError, what: str) -> None:
        """Count an interface that is down, which may come back; give up one that is gone."""
        if error.errno == errno.ENETDOWN:
            self._errors += 1
            return
        raise LinkError(f"{self.name}: cannot {what}: {error.strerror}") from None

    def ask(self, can_id: int, /) -> None:
        """Send a remote frame."""
        self._write(FRAME.pack(can_id | REMOTE, 8, 0), time.monotonic_ns() + _ASK_NS)

    def receive(self) -> list[Received]:
        """Drain the socket: all frames that have come, with the kernel's time stamps [ns].

        Raises: LinkError when the interface is gone
        """
        received: list[Received] = []
        read = self._raw.recvmsg
        for _ in range(0 if self._closed else _MOST_AT_ONCE):
            try:
                data, ancillary, _, _ = read(_FRAME_BYTES, _ANCILLARY_BYTES)
            except BlockingIOError:
                break
            except OSError as error:
                self._fail(error, "receive")
                break
            if len(data) != _FRAME_BYTES:
                continue
            can_id, length, word = FRAME.unpack(data)
            if can_id & ERROR_FLAG:
                self._bus_off += bool(can_id & BUS_OFF)
                self._notices.add(can_id, data[8:])
            elif length == 8:
                received.append((can_id, word, _stamp_ns(ancillary)))
        return received

    def settle(self) -> None:
        """Return at once: a wire reaches whoever is on it."""

    def notices(self) -> list[Notice]:
        """Return what the bus reported since the last time."""
        return self._notices.take()

    def counters(self) -> Mapping[str, int]:
        """Return error frames, bus-offs, writes tried again, frames that found no room."""
        return {
            "bus_errors": self._notices.count,
            "bus_off": self._bus_off,
            "errors": self._errors,
            "send_retried": self._retries,
            "send_full": self._full,
        }

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        self._closed = True
        self._raw.close()


def _stamp_ns(ancillary: list[tuple[int, int, bytes]]) -> int:
    """Return the kernel's time of arrival [ns], 0 when it gave none."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS:
            seconds, nanoseconds = _STAMP.unpack_from(data)
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return 0
