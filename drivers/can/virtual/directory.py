"""The directory of a channel: a socket, and a lock that dies with its process, for each node.

What a killed process left behind is told by its released lock and removed.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from drivers.zenoh.sockets import made, own_directory
from hil.errors import ConfigError

CHANNEL: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}", re.ASCII)
DIRECTORY_VARIABLE: Final = "HIL_CAN_DIRECTORY"

_MAX_SOCKET_PATH: Final = 107


def runtime_directory() -> Path:
    """Return where the channels of this user live; HIL_CAN_DIRECTORY puts them elsewhere."""
    given = os.environ.get(DIRECTORY_VARIABLE)
    return Path(given) if given else own_directory() / "can"


def channels() -> dict[str, int]:
    """Return the channels that are open on this machine, with how many nodes each has."""
    found = {}
    root = runtime_directory()
    for folder in sorted(root.iterdir()) if root.is_dir() else []:
        if folder.is_dir() and CHANNEL.fullmatch(folder.name):
            nodes = sum(1 for name in node_names(folder) if _is_held(folder / f"{name}.alive"))
            if nodes:
                found[folder.name] = nodes
    return found


def node_names(folder: Path) -> list[str]:
    """Return the names of all that have a file here, dead or alive."""
    return sorted(path.stem for path in folder.glob("*.alive"))


def _is_held(path: Path) -> bool:
    """Whether the process that made the file is still there: it holds a lock until it dies."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def sweep(folder: Path) -> list[str]:
    """Remove what dead processes left; returns the names of those that live."""
    living = []
    for name in node_names(folder):
        if _is_held(folder / f"{name}.alive"):
            living.append(name)
            continue
        for suffix in ("alive", "sock", "sock.lock"):
            (folder / f"{name}.{suffix}").unlink(missing_ok=True)
    return living


def folder_of(channel: str) -> Path:
    """Make the directory of a channel, for this user alone.

    Raises: ConfigError when the name, the directory or its owner will not do
    """
    if not CHANNEL.fullmatch(channel):
        raise ConfigError(
            f"CAN channel zenoh:{channel}: accepted letters, digits and _ . -, at most 32"
        )
    root = runtime_directory()
    folder = root / channel
    if len(str(folder)) > _MAX_SOCKET_PATH - 24:
        raise ConfigError(f"{folder}: too long for a unix socket; set {DIRECTORY_VARIABLE}")
    if DIRECTORY_VARIABLE not in os.environ:
        made(own_directory())
    made(root, DIRECTORY_VARIABLE, 0o022)  # the channel's own directory is closed
    return made(folder, DIRECTORY_VARIABLE)


@contextlib.contextmanager
def locked(file: int) -> Iterator[None]:
    """Hold the lock of an open file while the body runs; it is released with its process."""
    fcntl.flock(file, fcntl.LOCK_EX)
    try:
        yield
    finally:
        fcntl.flock(file, fcntl.LOCK_UN)
