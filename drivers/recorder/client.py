"""The recorder that a loop holds: puts the records of a tick into the ring of another process."""

from __future__ import annotations

import base64
import json
import select
import socket
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from drivers.recorder import ring, succession, tap
from drivers.recorder.account import NOTHING_LOST, Account
from drivers.recorder.output import open_output
from drivers.recorder.start import describe, joined
from hil import ports
from hil.errors import RunError
from hil.log.records import Topic
from hil.log.topics import ALL

RING_BYTES = 8 << 20  # ten seconds of a 1 kHz loop, a tenth of a second of a lockstep run
_DRAIN_BYTES_A_S = 10e6  # what a recorder takes at least, even on a busy machine
CHUNK_BYTES = 256 << 10
_POLL_MS = 1
_LOG_TIME = slice(15, 23)  # of the first record of a put

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


class NullRecorder(ports.Recorder):
    """A recorder for runs without a log."""

    pid: int | None = None

    def put(self, data: bytes, /) -> None:
        """Forget the bytes."""

    def watch(self, policy: str, on_end: OnEnd) -> None:
        """Nothing can be lost."""

    def close(self, timeout_s: float = 0.0) -> LogResult:
        """Return the counts of a log without messages."""
        return LogResult(0, 0)

    def raise_if_cut(self) -> None:
        """Do nothing: what is not written cannot be cut."""


class Recorder(ports.Recorder):
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
        live: socket.socket | None = None,
    ) -> None:
        self._path = path
        self._config = config
        self._live = live
        self._producer = producer
        self._put = producer.put
        self._control = control
        self._process = process
        self._blocking = blocking
        self._gone = self._closing = False
        self._result: LogResult | RunError | None = None
        self._account = Account(0, None, 0, NOTHING_LOST, 0, 0, 0)

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
        deferred: bool = False,
        live: socket.socket | None = None,
    ) -> Recorder:
        """Start the recorder process for a new log; an existing one is overwritten.

        Parameters: deferred : nothing is written before the end, or before the ring fills up;
            live : where others may look on, see tap.py; closed with the recorder

        Raises: ConfigError when the file cannot be written or another recorder still writes it
        """
        config = {
            "ring_bytes": ring_bytes,
            "chunk_bytes": min(CHUNK_BYTES, ring_bytes),
            "deferred": deferred,
            **log_config(path, metadata, attachments, topics, rotation),
        }
        parts = joined(open_output(path), config, live=live)
        return cls(path, *parts, blocking=blocking, config=config, live=live)

    def put(self, data: bytes, /) -> None:
        """Take the packed records of one tick as a whole."""
        if not self._put(data):
            self._put_full(data)

    def _put_full(self, data: bytes) -> None:
        waits = self._blocking and len(data) <= self._producer.capacity
        while waits and not self._is_gone(_POLL_MS):
            if self._put(data):
                return
        t_ns = int.from_bytes(data[_LOG_TIME], "little")
        self._producer.count_dropped(len(data), t_ns)

    def _is_gone(self, wait_ms: int = 0) -> bool:
        """Whether the recorder process has ended; it writes to the socket as its last act."""
        if not self._gone:
            poll = select.poll()  # one of its own: a signal may ask while a put is waiting
            poll.register(self._control, select.POLLIN | select.POLLHUP)
            self._gone = bool(poll.poll(wait_ms))
        return self._gone

    @property
    def pid(self) -> int | None:
        """Process number of the recorder process; None for that of a service manager."""
        return None if self._process is None else self._process.pid

    @property
    def dropped(self) -> int:
        """Puts that found no room."""
        return self._producer.dropped

    @property
    def waiting(self) -> int:
        """Bytes that the recorder process has not taken yet."""
        return self._producer.waiting

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
        out = open_output(self._path, forget=False)
        control = self._control
        _, self._control, self._process = joined(
            out, self._config, number + 1, self._producer, self._live
        )
        control.close()
        self._put, self._gone = self._producer.put, False

    def _note_first(self, text: str) -> None:
        """Log an event in front of what is put next, at its time."""
        put = self._producer.put

        def put_both(data: bytes) -> bool:
            self._put = put
            return put(succession.event(text, data) + data)

        self._put = put_both

    def close(self, timeout_s: float | None = None) -> LogResult:
        """Wait until the log is finished; a second call ends as the first did.

        Parameters: timeout_s : if None, as long as what is in the ring may take

        Raises: RunError when it was not finished in time, or not all of it could be written
        """
        self._closing = True
        if self._result is None:
            if self._live is not None:
                tap.remove(self._live)
            self._producer.close()
            patience_s = 10.0 + self.waiting / _DRAIN_BYTES_A_S
            try:
                self._result = self._finish(patience_s if timeout_s is None else timeout_s)
            except RunError as error:
                self._result = error
        if isinstance(self._result, RunError):
            raise self._result
        return self._result

    def raise_if_cut(self) -> None:
        """Tell of records that found no room and are later than the last one of the closed log.

        Raises: RunError
        """
        if self._account.is_cut:
            raise RunError(f"log {self._path} ends early: {self._account.text}")

    def _finish(self, timeout_s: float) -> LogResult:
        messages, error, lost_bytes, loss, *rest = self._wait_for_result(timeout_s)
        self._account = account = Account(messages, error, lost_bytes, ring.Loss(*loss), *rest)
        if account.error is not None:
            self.raise_if_cut()
        return LogResult(account.messages, account.loss.puts)

    def _wait_for_result(self, timeout_s: float) -> list[Any]:
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
        result: list[Any] = json.loads(answer)
        return result


def log_config(
    path: Path, metadata: Mapping[str, Mapping[str, str]], attachments: Sequence[Attachment],
    topics: Sequence[Topic] = ALL, rotation: Rotation | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Describe a log to whoever writes it: topics, rotation, what stands at its head."""
    return {
        **describe(topics),
        "rotation": None if rotation is None else _rotation(path, rotation),
        "metadata": {name: dict(values) for name, values in metadata.items()},
        "attachments": [(n, t, base64.b64encode(c).decode()) for n, t, c in attachments],
    }


def _rotation(path: Path, rotation: Rotation) -> dict[str, Any]:
    return {
        "path": str(path.resolve()),
        "bytes": rotation.segment_bytes,
        "ns": rotation.segment_ns,
        "retain_bytes": rotation.retain_bytes,
    }
