"""Ctrl-C at any moment, while modules are still imported too: one line and exit code 130."""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
import threading
from types import TracebackType
from typing import TYPE_CHECKING

from bench import streams

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

EXIT_CODE = 130
"""As a shell has it; this module comes before all others, so it imports none of ours."""

_AGAIN_S = 0.02
_said = threading.Event()


def guard() -> None:
    """Have an interrupt that nothing catches told in one line, and none lost in a callback of C.

    The interpreter ends itself by the signal, whatever exit code was asked for, if the interrupt
    came while a string was run, as for a named tuple: so the last of all that is run at exit ends
    the process.
    """
    atexit.register(_end)
    if sys.excepthook is sys.__excepthook__:
        sys.excepthook = _tell
    if sys.unraisablehook is sys.__unraisablehook__:
        sys.unraisablehook = _ask_again


def is_interrupt(error: BaseException | None) -> bool:
    """Whether an error came of an interrupt, as when a module in C fails to load because of it."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return error is not None


def told() -> int:
    """Say it once: another one while everything is put away is nothing new; the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _said.set()
    streams.say("interrupted")
    return EXIT_CODE


def _end() -> None:
    if _said.is_set():
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError):
                stream.flush()
        os._exit(EXIT_CODE)


def _tell(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    if not is_interrupt(error):
        sys.__excepthook__(kind, error, traceback)
        return
    streams.say("interrupted")
    os._exit(EXIT_CODE)  # the interpreter would end itself by the signal


def _ask_again(ignored: UnraisableHookArgs) -> None:
    if not issubclass(ignored.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(ignored)
        return
    threading.Timer(_AGAIN_S, os.kill, (os.getpid(), signal.SIGINT)).start()
