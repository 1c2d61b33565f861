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

from drivers.can.errors import BUS_OFF, ERROR_FLAG
from drivers.can.frames import HeadPlace, Notice, Notices, Received, Wanted
from drivers.can.virtual.records import EXTENDED, REMOTE
from hil.errors import ConfigError, LinkError
from hil.wire.codec import iter_frames

FRAME: Final = struct.Struct("<IB3xQ")
"""A classic frame of a little-endian kernel; its eight data bytes are read as one word."""

pack_frame: Final = FRAME.pack
unpack_frame: Final = FRAME.unpack

_AF_CAN, _CAN_RAW, _SOL_CAN_RAW = 29, 1, 101
_RAW_FILTER, _RAW_ERR_FILTER = 1, 2
_SO_TIMESTAMPNS: Final = 35
_STAMP: Final = struct.Struct("=qq")
unpack_stamp: Final = _STAMP.unpack
_FILTER: Final = struct.Struct("=II")
_STANDARD: Final = 0x7FF
_ALL_ERRORS: Final = 0x1FFFFFFF
_FRAME_BYTES, _DATA_BYTES = 16, 8
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(_STAMP.size)
_MOST_AT_ONCE: Final = 512
_RECEIVE_BYTES: Final = 1 << 20
_RETRY_S: Final = 50e-6
_ASK_NS: Final = 50_000_000
_NO_HEAD: Final = HeadPlace(1 << 32, 0, 0)  # beyond any identifier


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

    Parameters: raw : a socket as `open_socket` gives it; head : the frame that tells how many
        more are worth a read, without it all reads go on until nothing is left
    """

    def __init__(
        self,
        raw: socket.socket,
        channel: str,
        sleep: Callable[[float], None],
        head: HeadPlace = _NO_HEAD,
    ) -> None:
        self.name = f"socketcan:{channel}"
        self.stamps = True
        self._raw = raw
        self._sleep = sleep
        self._head_id, self._count_at, self._count_mask = head
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
        write = self._raw.send
        for can_id, word in iter_frames(batch):
            frame = pack_frame(can_id, 8, word)
            try:
                write(frame)
            except OSError as error:
                self._write_again(frame, deadline_ns, error)

    def _write_again(self, frame: bytes, deadline_ns: int, error: OSError) -> None:
        """Try a refused frame again; one that does not go out is counted, not queued for later."""
        while error.errno in {errno.ENOBUFS, errno.EAGAIN}:
            if time.monotonic_ns() >= deadline_ns:
                self._full += 1
                return
            self._retries += 1
            self._sleep(_RETRY_S)
            try:
                self._raw.send(frame)
            except OSError as again:
                error = again
            else:
                return
        self._fail(error, "send")

    def _fail(self, error: OSError, what: str) -> None:
        """Count an interface that is down, which may come back; give up one that is gone."""
        if error.errno == errno.ENETDOWN:
            self._errors += 1
            return
        raise LinkError(f"{self.name}: cannot {what}: {error.strerror}") from None

    def ask(self, can_id: int, /) -> None:
        """Send a remote frame."""
        frame = pack_frame(can_id | REMOTE, 8, 0)
        try:
            self._raw.send(frame)
        except OSError as error:
            self._write_again(frame, time.monotonic_ns() + _ASK_NS, error)

    def receive(self) -> list[Received]:
        """Read what has come, to the end of a tick, with the kernel's time stamps [ns].

        Raises: LinkError when the interface is gone
        """
        received: list[Received] = []
        try:
            for _ in range(0 if self._closed else _MOST_AT_ONCE):
                data, ancillary, _, _ = self._raw.recvmsg(_FRAME_BYTES, _ANCILLARY_BYTES)
                t_ns = _stamp_ns(ancillary)
                can_id, word = self._take(data, t_ns, received)
                if can_id == self._head_id:
                    self._read_tick(word >> self._count_at & self._count_mask, t_ns, received)
                    break
        except BlockingIOError:
            pass
        except OSError as error:
            self._fail(error, "receive")
        return received

    def _read_tick(self, count: int, t_ns: int, received: list[Received]) -> None:
        """Read what is there of a tick behind its head, at the time of the head [ns].

        A stamp of its own costs as much as a frame, as does a look that finds nothing.
        """
        read, take = self._raw.recv, self._take
        for _ in range(count - 1):
            take(read(_FRAME_BYTES), t_ns, received)

    def _take(self, data: bytes, t_ns: int, received: list[Received]) -> tuple[int, int]:
        """Put a data frame with eight bytes to the others; returns its identifier and word."""
        can_id, length, word = unpack_frame(data)
        if can_id & ERROR_FLAG:
            self._bus_off += bool(can_id & BUS_OFF)
            self._notices.add(can_id, data[8:])
        elif length == _DATA_BYTES:
            received.append((can_id, word, t_ns))
            return can_id, word
        return -1, 0

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
    """Return the kernel's time of arrival, all that it was asked to tell [ns]; 0 without one."""
    if not ancillary:
        return 0
    seconds, nanoseconds = unpack_stamp(ancillary[0][2])
    t_ns: int = seconds * 1_000_000_000 + nanoseconds
    return t_ns
