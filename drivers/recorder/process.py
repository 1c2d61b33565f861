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

from drivers.recorder.mcap_file import index_messages
from drivers.recorder.ring import Consumer
from drivers.recorder.segments import Segments
from drivers.recorder.unit import take_over
from hil.log.topics import EVENT, FAULT, WARNING

_POLL_MS = 10  # far below what the ring holds, far above what a wake-up costs
_FLUSH_S = 1.0  # a power cut costs no more than this much of a slow log


class Sink:
    """Collects records into chunks of a file; after a failed write it only counts bytes."""

    def __init__(self, file: Segments, chunk_bytes: int) -> None:
        self.error: str | None = None
        self.lost_bytes = 0
        self._file = file
        self._chunk_bytes = chunk_bytes
        self._pending = b""
        self._flushed_s = time.monotonic()
        self._last = (0, 0)
        self._dropped = 0

    def add(self, data: bytes, dropped: int) -> None:
        """Take bytes from the ring, which may end within a record, and the count of lost puts."""
        if self.error is not None:
            self.lost_bytes += len(data)
            return
        self._pending += data
        late = time.monotonic() - self._flushed_s > _FLUSH_S
        if late or len(self._pending) >= self._chunk_bytes:
            self.flush(dropped)

    def flush(self, dropped: int) -> None:
        """Write the whole records collected so far as a chunk, with an event about lost puts."""
        self._flushed_s = time.monotonic()
        if self.error is not None:
            return
        try:
            self._write(dropped)
        except (OSError, ValueError) as error:
            self.error = getattr(error, "strerror", None) or str(error)
            self.lost_bytes += len(self._pending)
            self._say_the_end(self.error)

    def _say_the_end(self, why: str) -> None:
        """Write an event as the last record, if what was kept free for it is there."""
        text = f"{why}: the log ends here, control goes on"
        with contextlib.suppress(OSError):
            self._file.add_last(EVENT.pack(*self._last, FAULT, "log-ended", text))

    def _write(self, dropped: int) -> None:
        index = index_messages(self._pending)
        data, rest = self._pending[: index.size], self._pending[index.size :]
        last = (index.last_tick, index.last_t_ns) if data else self._last
        if dropped > self._dropped:
            text = f"{dropped - self._dropped} ticks are missing here: the recorder was too slow"
            data += EVENT.pack(*last, WARNING, "log-dropped", text)
            index = index_messages(data)
        if data:
            self._file.add_chunk(data, index)
        self._pending, self._dropped, self._last = rest, dropped, last


def _drain(ring: Consumer, control: socket.socket, sink: Sink, chunk_bytes: int) -> None:
    """Move bytes from the ring to the sink until the other end of the control socket closes."""
    poll = select.poll()
    poll.register(control, select.POLLIN | select.POLLHUP)
    ended = False
    while True:
        data = ring.read(chunk_bytes, final=ended)
        sink.add(data, ring.dropped)
        if data:
            continue
        if ended:
            return
        ended = bool(poll.poll(_POLL_MS)) and not control.recv(64)


def _record(file: Segments, ring: Consumer, control: socket.socket, chunk: int) -> dict[str, Any]:
    """Fill and finish the file; return what the closing side is told."""
    sink = Sink(file, chunk)
    _drain(ring, control, sink, chunk)
    sink.flush(ring.dropped)
    result = {"error": sink.error, "lost_bytes": sink.lost_bytes, "dropped": ring.dropped}
    end = "closed" if ring.closed else "writer ended without closing the log"
    with contextlib.suppress(OSError):  # a full disk has its own line in the result
        values = {"end": end} | {key: str(value) for key, value in result.items() if value}
        file.add_metadata("recorder", values)
    file.finish()
    return {**result, "messages": file.messages}


def run(config: dict[str, Any]) -> None:
    """Record one log and tell the other end how it went."""
    control = socket.socket(fileno=config["control"])
    try:
        ring = Consumer(config["ring"])
        file = Segments(config["out"], config)
        result = _record(file, ring, control, config["chunk_bytes"])
    except OSError as error:
        result = {"error": error.strerror, "lost_bytes": 0, "dropped": 0, "messages": 0}
    with contextlib.suppress(OSError):  # nobody may be there any more
        control.send(json.dumps(result).encode())


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
