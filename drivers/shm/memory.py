"""Whose the shared memory is: files of names that no stranger foresees, closed, and really there.

A file in shared memory is made with its size and without its pages. A page that is not to be had is
a SIGBUS in the middle of a loop; so the pages are asked for here, where a refusal is one line.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from functools import cache
from pathlib import Path
from typing import Final

from drivers.zenoh.sockets import made, own_directory
from hil.errors import ConfigError, LinkError

SHARED: Final = Path("/dev/shm")
_KEY: Final = "shm-key"
_KEY_BYTES: Final = 8


def root() -> Path:
    """Return the directory of the nodes and services of this user.

    Raises: ConfigError when it is another user's, or others may enter or change it
    """
    return made(made(own_directory()) / "iceoryx2")


@cache
def _key(folder: Path) -> str:
    path = folder / _KEY
    with contextlib.suppress(FileExistsError):
        fresh = folder / f"{_KEY}-{os.getpid()}"
        fresh.touch(mode=0o600)
        fresh.write_text(secrets.token_hex(_KEY_BYTES), encoding="ascii")
        try:
            os.link(fresh, path)  # whole, or not at all: another process may do the same
        finally:
            fresh.unlink()
    key = path.read_text(encoding="ascii")
    if len(key) != 2 * _KEY_BYTES or not key.isalnum():
        raise ConfigError(
            f"{path}: no key of shared memory; accepted is what made it, so remove it"
        )
    return key


def prefix() -> str:
    """Return how the names of this user's files in shared memory begin; drawn once, then kept.

    Raises: ConfigError as `root`, or when the key was damaged
    """
    try:
        return f"hil_{_key(made(own_directory()))}_"
    except OSError as error:
        raise ConfigError(f"{error.filename}: {error.strerror}") from None


def _files(begins: str) -> list[Path]:
    return [path for path in SHARED.glob(f"{begins}*") if path.is_file()]


def close_to_others(begins: str) -> None:
    """Take from everybody else what the library gives to all: its file of all nodes."""
    for path in _files(begins):
        with contextlib.suppress(OSError):
            if path.stat().st_mode & 0o077:
                path.chmod(0o600)


def demand(begins: str, needed_bytes: int) -> None:
    """Refuse to go on where shared memory has not so much room.

    Raises: LinkError naming it
    """
    try:
        room = os.statvfs(SHARED)
    except OSError as error:
        raise LinkError(f"shm: {SHARED}: {error.strerror}") from None
    free = room.f_bavail * room.f_frsize
    if free < needed_bytes:
        raise LinkError(
            f"shm: {SHARED} has {free >> 10} kB left, the link needs {needed_bytes >> 10} kB"
            f" (files {begins}*)"
        )


def reserve(begins: str) -> None:
    """Have all pages of this user's files there, whatever else fills the memory later.

    Raises: LinkError when there is no room for them
    """
    for path in _files(begins):
        try:
            with path.open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        except FileNotFoundError:
            continue  # of a process that ended meanwhile
        except OSError as error:
            raise LinkError(f"shm: {path}: {error.strerror}") from None
