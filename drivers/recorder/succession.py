"""What becomes of a log whose recorder was lost: noticed at once, set aside, gone on with."""

from __future__ import annotations

import fcntl
import os
import signal
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Final

from hil.log.records import MESSAGE_HEAD
from hil.log.segments import segment_path, segments_before
from hil.log.topics import EVENT, FAULT

CODE: Final = "log-lost"
"""Code of the event that tells of it."""

_WAIT_S: Final = 0.1
_WATCHED: Final[dict[int, Callable[[], None]]] = {}


def watch(control: socket.socket, look: Callable[[], None]) -> None:
    """Have `look` called, between two instructions of the main thread, when a socket's peer ends.

    It is called for other sockets too, and has to see for itself.
    """
    if not _WATCHED:
        signal.signal(signal.SIGIO, _look)
    _WATCHED[id(look)] = look
    fcntl.fcntl(control, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(control, fcntl.F_SETFL, fcntl.fcntl(control, fcntl.F_GETFL) | os.O_ASYNC)


def _look(_number: int, _frame: FrameType | None) -> None:
    for look in tuple(_WATCHED.values()):
        look()


def told(process: subprocess.Popen[bytes] | None) -> str:
    """Return in words how the recorder process has ended."""
    if process is None:
        return "the recorder's unit has ended"
    try:
        code = process.wait(_WAIT_S)
    except subprocess.TimeoutExpired:
        return f"its recorder (pid {process.pid}) has closed its end"
    how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
    return f"its recorder (pid {process.pid}) {how}"


def set_aside(path: Path) -> int:
    """Let the file so far, as it was left, be a segment of the log; returns its number."""
    earlier = segments_before(path)
    number = int(earlier[-1].stem.rpartition(".")[2]) + 1 if earlier else 1
    path.rename(segment_path(path, number))
    return number


def event(text: str, data: bytes) -> bytes:
    """Return the record that tells of it, of the tick of these records."""
    _, _, _, tick, t_ns, *_ = MESSAGE_HEAD.unpack_from(data)
    return EVENT.pack(tick, t_ns, FAULT, CODE, text)
