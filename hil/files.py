"""Files that come in and files that go out: one rule for each.

What is read is a regular file: a pipe, a device or a directory under its name would hang, or give
no end of bytes. What is written is refused where a file is already, unless its replacement is asked
for; it is written beside its place and gets its name when it is whole.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Final, NamedTuple

from hil.errors import ConfigError, HilError, RunError

_NO_ROOM: Final = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}


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
        raise kind(f"{path}: {_kind_of(path)}")
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path, kind: type[HilError] = ConfigError) -> bytes:
    """Return the bytes of a regular file, or raise as `open_regular`."""
    try:
        with open_regular(path, kind) as file:
            return file.read()
    except OSError as error:
        raise kind(f"{path}: {_why(error)}") from None


def _kind_of(path: Path) -> str:
    if path.is_dir():
        return os.strerror(errno.EISDIR)
    return "a pipe, a socket or a device; accepted is a regular file"


def _why(error: OSError | ValueError) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


class Output(NamedTuple):
    """A file that a command is to write: `option` names it, `inputs` are what the command reads."""

    option: str
    path: Path
    force: bool = False
    inputs: tuple[Path, ...] = ()

    def check(self, *suffixes: str) -> None:
        """Refuse a file that must not or could not be written after the work.

        Nothing is left behind.

        Raises: ConfigError naming the option and what is accepted
        """
        if suffixes and self.path.suffix.lower() not in suffixes:
            raise self._refusal(f"accepted is a name ending in {', '.join(suffixes)}")
        try:
            self._check_place()
            beside = self._beside()
            beside.open("xb").close()
            beside.unlink()
        except (OSError, ValueError) as error:
            raise self._told(error) from None

    @contextmanager
    def writing(self) -> Iterator[Path]:
        """Yield a name beside the file to write to; what is whole gets the file's name at the end.

        Raises: ConfigError when it must not or cannot be written, RunError when there is no room
        """
        try:
            beside = self._beside()
            try:
                yield beside
                self._check_place()
                self._put_in_place(beside)
            finally:
                beside.unlink(missing_ok=True)
        except OSError as error:
            raise self._told(error) from None

    def write(self, content: str | bytes) -> None:
        """Write the whole file, as `writing`."""
        data = content.encode() if isinstance(content, str) else content
        with self.writing() as beside:
            beside.write_bytes(data)

    def _check_place(self) -> None:
        path = self.path
        if not path.exists():
            return
        if any(other.exists() and path.samefile(other) for other in self.inputs):
            raise self._refusal(
                "exists already, and is read by this command; accepted is another name"
            )
        if not path.is_file():
            raise self._refusal(_kind_of(path))
        if not self.force:
            raise self._refusal("exists already; accepted is another name, or --force")

    def _beside(self) -> Path:
        """Return a name in the same directory that is nobody else's, with the same ending."""
        target = self.path.resolve()
        return target.with_name(f".{target.stem[:100]}.{os.getpid()}.part{target.suffix}")

    def _put_in_place(self, beside: Path) -> None:
        """Give the file its name; without force not over another that has come meanwhile."""
        target = self.path.resolve()
        if not self.force:
            with suppress(PermissionError, NotImplementedError):  # a file system without links
                os.link(beside, target)
                return
        beside.replace(target)

    def _refusal(self, text: str) -> ConfigError:
        return ConfigError(f"{self.option} {self.path}: {text}")

    def _told(self, error: OSError | ValueError) -> HilError:
        if isinstance(error, FileExistsError):
            return self._refusal("exists already; accepted is another name, or --force")
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            return RunError(f"{self.option} {self.path}: {_why(error)}")
        return self._refusal(_why(error))
