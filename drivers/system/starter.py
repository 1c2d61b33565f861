"""Who started a process: when that one is gone the process does not go on alone.

The kernel sends SIGHUP when the starter ends, however it ends; a closed terminal sends the same.
"""

from __future__ import annotations

import ctypes
import os
import signal
from typing import Final

VARIABLE: Final = "HIL_STARTER"
"""Process number of the starter that a process must not outlive."""

LOST: Final = "starter-lost"
"""Code of the event that says so, in the log of whoever was left alone."""

TERMINAL_GONE: Final = "the terminal is gone"

_PR_SET_PDEATHSIG: Final = 1


def environment() -> dict[str, str]:
    """Return the environment of a process that is not to outlive this one."""
    return {**os.environ, VARIABLE: str(os.getpid())}


def pid() -> int | None:
    """Return the process number of the starter; None for a process that stands alone."""
    told = os.environ.get(VARIABLE, "")
    return int(told) if told.isdigit() else None


def bind() -> bool:
    """Have SIGHUP sent at the starter's end; returns whether it is gone by now.

    The signal's handler must be there before. Bound is the process that the starter itself has
    started: what that one starts in its turn ends with it.
    """
    starter = pid()
    if starter is None:
        return False
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, ctypes.c_ulong(signal.SIGHUP), 0, 0, 0)
    return os.getppid() != starter


def end_told() -> str:
    """Return in words why SIGHUP has come."""
    starter = pid()
    return TERMINAL_GONE if starter is None else f"its starter (pid {starter}) is gone"
