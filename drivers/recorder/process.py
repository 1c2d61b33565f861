"""The process that turns the bytes of a ring into an MCAP file, and outlives who fills the ring.

It gets open descriptors and a description of the log, nothing by its command line: whoever
starts it (a `Recorder`, a service manager) decides what it may touch. It ends when the other
end of the control socket is closed, on purpose or by a kill, after finishing the file.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import stat
import sys
import time
from typing import Any

from drivers.recorder.account import NOTHING_LOST, Account, loss_text
from drivers.recorder.index import MessageIndex, index_messages
from drivers.recorder.ring import Consumer, Loss
from drivers.recorder.segments import Segments
from drivers.recorder.tap import Door
from drivers.recorder.unit import take_over
from hil.log.topics import EVENT, FAULT, WARNING

_POLL_MS = 10  # far below what the ring holds, far above what a wake-up costs
_DEFERRED_FILL = 0.875  # of the ring; from there on a deferred recording goes on at once
_FLUSH_S = 0.05  # with a poll or two: what a kill of this process, or a power cut, may cost


class Sink:
    """Collects records into chunks of a file; after a failed write it only counts bytes.

    end_ns: log time of the last record written
    """

    def __init__(self, file: Segments, chunk_bytes: int) -> None:
        self.error: str | None = None
        self.lost_bytes = 0
        self._file = file
        self._chunk_bytes = chunk_bytes
        self._pending = bytearray()
        self._since_s = 0.0
        self._last = (0, 0)
        self._noted = NOTHING_LOST

    @property
    def end_ns(self) -> int:
        """Log time of the last record written [ns]."""
        return self._last[1]

    @property
    def pending(self) -> int:
        """Bytes that were taken and are not written yet."""
        return len(self._pending)

    def add(self, data: bytes) -> None:
        """Take bytes from the ring, which may end within a record."""
        if self.error is not None:
            self.lost_bytes += len(data)
            return
        if data and not self._pending:
            self._since_s = time.monotonic()
        self._pending += data
        size = len(self._pending)
        if size >= self._chunk_bytes or (size and time.monotonic() - self._since_s > _FLUSH_S):
            self.flush()

    def flush(self) -> None:
        """Write the whole records collected so far as a chunk."""
        if self.error is not None:
            return
        data = bytes(self._pending)
        try:
            index = index_messages(data)
        except ValueError as error:
            self._give_up(str(error))
            return
        if not index.size:
            return
        del self._pending[: index.size]
        self._since_s = time.monotonic()
        self._write(data[: index.size], index)
        if self.error is None:
            self._last = (index.last_tick, index.last_t_ns)

    def note(self, loss: Loss) -> None:
        """Write an event about puts that were given up since the last one, if there are any."""
        if loss.puts == self._noted.puts:
            return
        self.flush()
        if self.error is not None:
            return
        data = EVENT.pack(*self._last, WARNING, "log-dropped", loss_text(self._noted, loss))
        self._noted = loss
        self._write(data, index_messages(data))

    def _write(self, data: bytes, index: MessageIndex) -> None:
        try:
            self._file.add_chunk(data, index)
        except OSError as error:
            self.lost_bytes += len(data)
            self._give_up(error.strerror or str(error))

    def _give_up(self, why: str) -> None:
        """Write an event as the last record, if what was kept free for it is there."""
        self.error = why
        self.lost_bytes += len(self._pending)
        text = f"{why}: the log ends here, control goes on"
        with contextlib.suppress(OSError):
            self._file.add_last(EVENT.pack(*self._last, FAULT, "log-ended", text))


class _Calls:
    """What this process listens to besides its ring: its writer's end, and readers at the door."""

    def __init__(self, control: socket.socket, door: Door | None) -> None:
        self._control = control
        self._door = door
        self._poll = select.poll()
        self._poll.register(control, select.POLLIN | select.POLLHUP)
        if door is not None:
            self._poll.register(door, select.POLLIN)

    def have_ended(self, wait_ms: int) -> bool:
        """Wait for a call and take it; returns whether the writer has ended."""
        calls = [descriptor for descriptor, _ in self._poll.poll(wait_ms)]
        if self._door is not None and self._door.fileno() in calls:
            self._door.answer()
        return self._control.fileno() in calls and not self._control.recv(64)


def _drain(ring: Consumer, calls: _Calls, sink: Sink, chunk_bytes: int, *, deferred: bool) -> None:
    """Move bytes from the ring to the sink until the other end of the control socket closes."""
    ended = False
    while True:
        rests = deferred and not ended and ring.waiting < _DEFERRED_FILL * ring.capacity
        data = b"" if rests else ring.read(chunk_bytes, final=ended)
        sink.add(data)
        ring.note_written(sink.pending)
        if ring.dropped_before:
            sink.note(ring.loss)
        if not ended:  # of a full chunk there is more: no wait
            ended = calls.have_ended(0 if len(data) == chunk_bytes else _POLL_MS)
        elif not data:
            return


def _record(
    file: Segments, ring: Consumer, control: socket.socket, config: dict[str, Any]
) -> Account:
    """Fill and finish the file; return how it went."""
    sink = Sink(file, config["chunk_bytes"])
    calls = _Calls(control, _door(config))
    _drain(ring, calls, sink, config["chunk_bytes"], deferred=config.get("deferred", False))
    sink.flush()
    sink.note(ring.loss)
    account = Account(
        file.messages, sink.error, sink.lost_bytes, ring.loss, sink.end_ns, ring.capacity, ring.most
    )
    end = "closed" if ring.closed else "writer ended without closing the log"
    with contextlib.suppress(OSError):  # a full disk has its own line in the account
        file.add_metadata("recorder", {"end": end} | account.metadata())
    file.finish()
    return account._replace(messages=file.messages)


def _door(config: dict[str, Any]) -> Door | None:
    """Return where readers of the ring are let in, None where nobody can come."""
    if config.get("live") is None:
        return None
    return Door(socket.socket(fileno=config["live"]), config["ring"], config)


def run(config: dict[str, Any]) -> None:
    """Record one log and tell the other end how it went."""
    control = socket.socket(fileno=config["control"])
    try:
        ring = Consumer(config["ring"])
        file = Segments(config["out"], config)
        account = _record(file, ring, control, config)
    except OSError as error:
        account = Account(0, error.strerror, 0, NOTHING_LOST, 0, 0, 0)
    with contextlib.suppress(OSError):  # nobody may be there any more
        control.send(json.dumps(account).encode())


def main() -> None:
    """Record the log that standard input describes."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the end of the writer is what ends this process
    if os.sched_getscheduler(0) != os.SCHED_OTHER:  # inherited from a real-time loop
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    handed_over = stat.S_ISSOCK(os.fstat(0).st_mode)  # started by a service manager
    run(take_over(0) if handed_over else json.load(sys.stdin))


if __name__ == "__main__":
    main()
