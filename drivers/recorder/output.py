"""The file of a log: one recorder writes it at a time, and others can tell when it is finished."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path

from hil.errors import ConfigError, RunError
from hil.log.segments import segments_before


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


def open_output(path: Path, *, forget: bool = True) -> int:
    """Open a log's file, lock it and empty it; earlier segments go unless they are to be kept.

    Raises: ConfigError when it cannot be written or another recorder writes it
    """
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
