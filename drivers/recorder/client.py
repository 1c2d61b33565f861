"""The recorder that a loop holds: puts the records of a tick into the ring of another process."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import select
import socket
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from drivers.recorder import ring, succession
from drivers.recorder.start import describe, joined
from hil.errors import ConfigError, RunError
from hil.log.records import Topic
from hil.log.segments import segments_before
from hil.log.topics import ALL

RING_BYTES = 8 << 20  # ten seconds of a 1 kHz loop, a tenth of a second of a lockstep run
CHUNK_BYTES = 256 << 10
_POLL_MS = 1

Attachment = tuple[str, str, bytes]  # name, media type, content
OnEnd = Callable[[str, str], None]  # with the code of an event and its text


class Rotation(NamedTuple):
    """When a log goes on in another file, and how much of it is kept."""

    segment_bytes: int | None = None
    segment_ns: int | None = None
    retain_bytes: int | None = None


class LogResult(NamedTuple):
    """What `close` tells of a finished log."""

    messages: int
    dropped: int


class NullRecorder:
    """A recorder for runs without a log."""

    pid: int | None = None

    def put(self, data: bytes, /) -> None:
        """Forget the bytes."""

    def watch(self, policy: str, on_end: OnEnd) -> None:
        """Nothing can be lost."""

    def close(self, timeout_s: float = 0.0) -> LogResult:
        """Return the counts of a log without messages."""
        return LogResult(0, 0)


class Recorder:
    """Hands packed records to a recorder process; `put` does no I/O.

    A full ring makes a blocking recorder wait and another one drop the put, which it counts.
    When the recorder process is gone the puts are counted as dropped, and `close` tells.
    """

    def __init__(
        self,
        path: Path,
        producer: ring.Producer,
        control: socket.socket,
        process: subprocess.Popen[bytes] | None,
        *,
        blocking: bool,
        config: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self._path = path
        self._config = config
        self._producer = producer
        self._put = producer.put
        self._control = control
        self._process = process
        self._blocking = blocking
        self._gone = self._closing = False
        self._result: LogResult | RunError | None = None
        self._poll = select.poll()
        self._poll.register(control, select.POLLIN | select.POLLHUP)

    @classmethod
    def open(
        cls,
        path: Path,
        metadata: Mapping[str, Mapping[str, str]],
        attachments: Sequence[Attachment] = (),
        *,
        blocking: bool,
        topics: Sequence[Topic] = ALL,
        ring_bytes: int = RING_BYTES,
        rotation: Rotation | None = None,
    ) -> Recorder:
        """Start the recorder process for a new log; an existing one is overwritten.

        Raises: ConfigError when the file cannot be written or another recorder still writes it
        """
        config = {
            "ring_bytes": ring_bytes,
            "chunk_bytes": min(CHUNK_BYTES, ring_bytes),
            **describe(topics),
            "rotation": None if rotation is None else _rotation(path, rotation),
            "metadata": {name: dict(values) for name, values in metadata.items()},
            "attachments": [(n, t, base64.b64encode(c).decode()) for n, t, c in attachments],
        }
        return cls(path, *joined(_open_output(path), config), blocking=blocking, config=config)

    def put(self, data: bytes, /) -> None:
        """Take the packed records of one tick as a whole."""
        if not self._put(data):
            self._put_full(data)

    def _put_full(self, data: bytes) -> None:
        waits = self._blocking and len(data) <= self._producer.capacity
        while waits and not self._is_gone(_POLL_MS):
            if self._put(data):
                return
        self._producer.count_dropped()

    def _is_gone(self, wait_ms: int = 0) -> bool:
        """Whether the recorder process has ended; it writes to the socket as its last act."""
        if not self._gone and self._poll.poll(wait_ms):
            self._gone = True
        return self._gone

    @property
    def pid(self) -> int | None:
        """Process number of the recorder process; None for that of a service manager."""
        return None if self._process is None else self._process.pid

    @property
    def dropped(self) -> int:
        """Puts that found no room."""
        return self._producer.dropped

    def watch(self, policy: str, on_end: OnEnd) -> None:
        """Have the loss of the recorder process noticed when it happens, by a signal.

        Another one goes on with the log in any case, if only to say so in it.

        Parameters: policy : "restart" goes on with the run, "end" calls `on_end`
        """

        def take_over() -> None:
            if self._closing or not self._is_gone():
                return
            told = succession.told(self._process)
            try:
                self._begin_again()
            except (OSError, RunError) as error:
                on_end(succession.CODE, f"{told}, and no other one can be started: {error}")
                return
            if policy == "end":
                on_end(succession.CODE, told)
            else:
                self._note_first(f"{told}, another one goes on from here")
            succession.watch(self._control, take_over)

        succession.watch(self._control, take_over)

    def _begin_again(self) -> None:
        """Have another recorder go on with the log, whose file so far becomes a segment."""
        number = succession.set_aside(self._path)
        out = _open_output(self._path, forget=False)
        control = self._control
        self._producer, self._control, self._process = joined(out, self._config, number + 1)
        control.close()
        self._put, self._gone = self._producer.put, False
        self._poll = select.poll()
        self._poll.register(self._control, select.POLLIN | select.POLLHUP)

    def _note_first(self, text: str) -> None:
        """Log an event in front of what is put next, at its time."""
        put = self._producer.put

        def put_both(data: bytes) -> bool:
            self._put = put
            return put(succession.event(text, data) + data)

        self._put = put_both

    def close(self, timeout_s: float = 10.0) -> LogResult:
        """Wait until the log is finished; a second call ends as the first did.

        Raises: RunError when it was not finished in time, or not all of it could be written
        """
        self._closing = True
        if self._result is None:
            self._producer.close()
            try:
                self._result = self._finish(timeout_s)
            except RunError as error:
                self._result = error
        if isinstance(self._result, RunError):
            raise self._result
        return self._result

    def _finish(self, timeout_s: float) -> LogResult:
        result = self._wait_for_result(timeout_s)
        if result["error"]:
            lost = f"{result['lost_bytes']} bytes of records are lost"
            raise RunError(f"log {self._path} ends early: {result['error']}; {lost}")
        return LogResult(result["messages"], result["dropped"])

    def _wait_for_result(self, timeout_s: float) -> dict[str, Any]:
        deadline_s = time.monotonic() + timeout_s
        with self._control as control:
            control.shutdown(socket.SHUT_WR)
            control.settimeout(timeout_s)
            try:
                answer = control.recv(1 << 16)
                if self._process is not None:
                    self._process.wait(max(deadline_s - time.monotonic(), 0.1))
            except (TimeoutError, subprocess.TimeoutExpired):
                late = f"log {self._path} was not finished within {timeout_s:g} s"
                raise RunError(late) from None
            except ConnectionError:
                answer = b""
        if not answer:
            code = "no message" if self._process is None else self._process.wait()
            raise RunError(f"log {self._path}: its recorder ended with {code}, repair the file")
        result: dict[str, Any] = json.loads(answer)
        return result


def _rotation(path: Path, rotation: Rotation) -> dict[str, Any]:
    return {
        "path": str(path.resolve()),
        "bytes": rotation.segment_bytes,
        "ns": rotation.segment_ns,
        "retain_bytes": rotation.retain_bytes,
    }


def wait_finished(path: Path, timeout_s: float) -> None:
    """Wait until no recorder writes the log any more, such as that of a killed process.

    Raises: RunError when the file is missing or still being written after the time
    """
    deadline_s = time.monotonic() + timeout_s
    while not _is_finished(path):
        if time.monotonic() > deadline_s:
            raise RunError(f"log {path} is still being written after {timeout_s:g} s")
        time.sleep(0.005)


def _is_finished(path: Path) -> bool:
    """Whether nobody holds the lock of the file that has the log's name, now and afterwards."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise RunError(f"log {path}: {error.strerror}") from None
    try:
        # A file that has lost its name meanwhile is an earlier segment of a log that goes on.
        return _try_lock(fd, fcntl.LOCK_SH) and os.fstat(fd).st_ino == path.stat().st_ino
    finally:
        os.close(fd)


def _try_lock(fd: int, kind: int) -> bool:
    """Lock the open file, if no other holds it; the lock lives as long as any copy of `fd`."""
    try:
        fcntl.flock(fd, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _open_output(path: Path, *, forget: bool = True) -> int:
    try:
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise ConfigError(f"log {path} cannot be written: {error.strerror}") from None
    if not _try_lock(fd, fcntl.LOCK_EX):
        os.close(fd)
        raise ConfigError(f"log {path} is being written by another recorder")
    os.ftruncate(fd, 0)
    for segment in segments_before(path) if forget else ():  # of the log that is overwritten
        segment.unlink(missing_ok=True)
    return fd
