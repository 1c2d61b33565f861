"""Files that come in and files that go out: one rule for each.

What is read is a regular file: a pipe, a device or a directory under its name would hang, or give
no end of bytes. What is written is refused where a file is already, unless its replacement is asked
for; it is written beside its place and gets its name when it is whole.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from hil.errors import ConfigError, HilError


def open_regular(path: Path, kind: type[HilError] = ConfigError) -> IO[bytes]:
    """Open a file for reading, without waiting for the other end of a pipe.

    Raises: an error of that kind, one line, when it is missing or no regular file
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        raise kind(f"{path}: {_why(error)}") from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise kind(f"{path}: {_kind_of(path)}: accepted is a regular file")
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path, kind: type[HilError] = ConfigError) -> bytes:
    """Return the bytes of a regular file, or raise as `open_regular`."""
    try:
        with open_regular(path, kind) as file:
            return file.read()
    except OSError as error:
        raise kind(f"{path}: {_why(error)}") from None


def _kind_of(path: Path) -> str:
    return "a directory" if path.is_dir() else "no regular file (a pipe, a socket or a device)"


def _why(error: OSError | ValueError) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def check_output(
    option: str, path: Path, *suffixes: str, force: bool = False, inputs: Iterable[Path] = ()
) -> None:
    """Refuse a file that must not or could not be written after the work; leave nothing behind.

    Raises: ConfigError naming the option and what is accepted
    """
    named = f"{option} {path}"
    if not path.name:
        raise ConfigError(f"{option} {str(path)!r}: accepted is the name of a file")
    if suffixes and path.suffix.lower() not in suffixes:
        raise ConfigError(f"{named}: accepted is a name ending in {', '.join(suffixes)}")
    try:
        _check_place(named, path, force=force, inputs=inputs)
        beside = _beside(path)
        beside.open("xb").close()
        beside.unlink()
    except (OSError, ValueError) as error:
        raise ConfigError(f"{named}: {_why(error)}") from None


def _check_place(named: str, path: Path, *, force: bool, inputs: Iterable[Path]) -> None:
    if not os.path.lexists(path):
        return
    if path.exists() and any(other.exists() and path.samefile(other) for other in inputs):
        told = "exists already, and is read by this command; accepted is another name"
        raise ConfigError(f"{named}: {told}")
    if path.exists() and not path.is_file():
        raise ConfigError(f"{named}: {_kind_of(path)}: accepted is a regular file")
    if not force:
        raise ConfigError(f"{named}: exists already; accepted is another name, or --force")


@contextmanager
def output(
    option: str, path: Path, *, force: bool = False, inputs: Iterable[Path] = ()
) -> Iterator[Path]:
    """Yield a name beside the file to write to; what is whole gets the file's name at the end.

    Raises: ConfigError naming the option when it must not or cannot be written
    """
    named = f"{option} {path}"
    try:
        beside = _beside(path)
        try:
            yield beside
            _check_place(named, path, force=force, inputs=inputs)
            _put_in_place(beside, path, force=force)
        finally:
            beside.unlink(missing_ok=True)
    except FileExistsError:
        raise ConfigError(
            f"{named}: exists already; accepted is another name, or --force"
        ) from None
    except OSError as error:
        raise ConfigError(f"{named}: {_why(error)}") from None


def write_output(
    option: str, path: Path, content: str | bytes, *, force: bool = False,
    inputs: Iterable[Path] = (),
) -> None:  # fmt: skip
    """Write a whole file, as `output`."""
    data = content.encode() if isinstance(content, str) else content
    with output(option, path, force=force, inputs=inputs) as beside:
        beside.write_bytes(data)


def _beside(path: Path) -> Path:
    """Return a name in the same directory that is nobody else's, with the same ending."""
    target = path.resolve()
    return target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")


def _put_in_place(beside: Path, path: Path, *, force: bool) -> None:
    """Give a file its name; without force not over another that has come meanwhile."""
    target = path.resolve()
    if not force:
        with suppress(PermissionError, NotImplementedError):  # a file system without links
            os.link(beside, target)
            return
    beside.replace(target)
