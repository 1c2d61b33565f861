"""The private directory of a run's sockets: locked for as long as the run lives.

One whose run was killed is unlocked, and removed at the next start. It gets its name only once
it is locked, so that nobody takes one that is being made for one that was left.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from hil.errors import ConfigError

_PREFIX: Final = "hil-run-"
_POINTER: Final = "run"
"""File beside the sockets that names the directory of the run."""

_MAX_SOCKET_PATH: Final = 107  # sun_path of a unix socket, without its closing zero


@contextlib.contextmanager
def socket_directory() -> Iterator[Path]:
    """Yield a private directory whose sockets have paths that the kernel accepts.

    Raises: ConfigError
    """
    base = Path(tempfile.gettempdir())
    sweep(base)
    try:
        making = Path(tempfile.mkdtemp(prefix=".hil-", dir=base))
    except OSError as error:
        raise ConfigError(f"TMPDIR {base}: {error.strerror}") from None
    lock = _locked(making)
    directory = base / f"{_PREFIX}{making.name.removeprefix('.hil-')}"
    making.rename(directory)
    try:
        if len(str(directory / "controller.sock")) > _MAX_SOCKET_PATH:
            raise ConfigError(f"TMPDIR {base}: too long for a unix socket")
        yield directory
    finally:
        shutil.rmtree(directory, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def point_to(run: Path, endpoint: str) -> None:
    """Let who looks for a run by its sockets find its directory."""
    sockets = Path(endpoint.partition("/")[2]).parent
    if sockets.name.startswith(_PREFIX):
        (sockets / _POINTER).write_text(str(run.resolve()), encoding="utf-8")


def running() -> list[Path]:
    """Return the directories of the runs of this user that are under way."""
    found = []
    for sockets in sorted(Path(tempfile.gettempdir()).glob(f"{_PREFIX}*")):
        lock = _locked(sockets)
        if lock is not None:  # nobody's any more
            os.close(lock)
            continue
        with contextlib.suppress(OSError):
            if sockets.stat().st_uid == os.getuid():
                found.append(Path((sockets / _POINTER).read_text(encoding="utf-8")))
    return found


def sweep(base: Path) -> None:
    """Remove what killed runs of this user have left."""
    for directory in base.glob(f"{_PREFIX}*"):
        lock = _locked(directory)
        if lock is not None:
            shutil.rmtree(directory, ignore_errors=True)
            os.close(lock)


def _locked(directory: Path) -> int | None:
    """Return the descriptor that holds the lock; None when it is another's."""
    try:
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return None
    with contextlib.suppress(OSError):
        if os.fstat(descriptor).st_uid == os.getuid():
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return descriptor
    os.close(descriptor)
    return None
