"""Standard streams as they may be: closed, a pipe without a reader, a full disk, an ASCII terminal.

It comes before all others, so it imports none of ours.
"""

from __future__ import annotations

import codecs
import contextlib
import errno
import io
import os
import sys
from typing import Any, Final

READER_GONE: Final = 141
"""Exit code, as a shell has it for SIGPIPE."""

_PLAIN: Final = {
    "✓": "+", "✗": "-", "µ": "u", "±": "+-", "×": "x", "…": "...", "·": "-", "–": "-", "σ": "s",
    "━": "=", "╸": "-", "╺": "-",
}  # fmt: skip


def reopen() -> None:
    """Let no file of ours get the number of a standard stream that is closed."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(number, "w" if number else "r", encoding="utf-8"))


class Outlet(io.RawIOBase):
    """Standard output; what could not be written to it is remembered."""

    def __init__(self, number: int) -> None:
        self.error: OSError | None = None
        self.outlived = False
        self._number = number

    def write(self, data: bytes, /) -> int:  # type: ignore[override]  # a buffer
        """Write, or once nobody can read it: forget, where the work has another outcome too.

        Raises: OSError
        """
        if self.error is None:
            try:
                return os.write(self._number, data)
            except OSError as error:
                self.error = error
        if not self.outlived:
            raise OSError(self.error.errno, self.error.strerror, "standard output")
        return len(data)

    def fileno(self) -> int:
        """Its number."""
        return self._number

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return os.isatty(self._number)

    def writable(self) -> bool:
        """Always."""
        return True

    def exit_code(self, code: int) -> int:
        """Return what a command ends with that would end with `code`; say what is to be said.

        A verdict that nobody could read is not told by the exit code alone.
        """
        with contextlib.suppress(OSError):
            sys.stdout.flush()
        self.outlived = True  # the interpreter flushes once more
        if self.error is None or code not in {0, 1, 4}:
            return code
        if self.error.errno in {errno.EPIPE, errno.EIO}:  # EIO: the terminal is gone
            return READER_GONE
        say(f"standard output: {self.error.strerror}")
        return 3


def install() -> Outlet:
    """Put an outlet under standard output, unless something else has taken its place."""
    outlet = Outlet(1)
    codecs.register_error("plain", _plainly)
    if sys.stdout is sys.__stdout__ and isinstance(sys.stdout, io.TextIOWrapper):
        errors = "plain" if sys.stdout.errors == "strict" else sys.stdout.errors
        below: Any = io.BufferedWriter(outlet)
        sys.stdout = io.TextIOWrapper(
            below, sys.stdout.encoding, errors, line_buffering=outlet.isatty()
        )
    return outlet


def outlive() -> None:
    """From here on the work goes on without a reader of standard output, and is told in files."""
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    if isinstance(raw, Outlet):
        raw.outlived = True


def say(line: str) -> None:
    """Put a line on standard error, if anybody can read it."""
    with contextlib.suppress(OSError):
        print(line, file=sys.stderr, flush=True)


def _plainly(error: UnicodeError) -> tuple[str, int]:
    """Spell what an encoding has not in signs that it has."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    bad = error.object[error.start : error.end]
    return "".join(_PLAIN.get(sign, "?") for sign in bad), error.end
