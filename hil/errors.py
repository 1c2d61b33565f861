"""The error tree: every failure a user can meet has one class, one line and one exit code."""

from __future__ import annotations

import shlex
import sys


def printable(text: str) -> str:
    """Return a text that may go to a terminal: what a file put into it steers nothing."""
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


class HilError(Exception):
    """A failure that is told to the user in one line; `exit_code` is what the command ends with."""

    exit_code = 3

    def __str__(self) -> str:
        """Say it without control characters."""
        return printable(super().__str__())


class ConfigError(HilError):
    """An argument, scenario or configuration that cannot be used: names file, key and range."""

    exit_code = 2


class MissingExtraError(ConfigError):
    """An optional library is needed for what was asked and is not installed."""

    def __init__(self, library: str, extra: str, purpose: str) -> None:
        super().__init__(f"{purpose} needs {library}: {install_command(extra)}")


def install_command(extra: str = "") -> str:
    """Return what installs the project, or an extra of it, where this interpreter looks for it."""
    project = f"'fpeg-hil[{extra}]'" if extra else "fpeg-hil"
    return f"{shlex.quote(sys.executable)} -m pip install {project}"


class LogError(HilError):
    """A log file that cannot be used: names the file and what is wrong with it."""

    exit_code = 2


class RunError(HilError):
    """A fault at run time: a lost peer, a process that died, a device that failed."""


class InterruptedRunError(RunError):
    """Ctrl-C has ended a run before its time."""

    exit_code = 130


PEER_LOST = "lost: no valid"
"""What a process says in the end that has gone to its safe state without its peer."""


class LinkError(RunError):
    """A link that could not be opened, or that broke."""


class RefusedError(LinkError):
    """Another process is already what this one was to be."""


class BlockedError(HilError):
    """A refused order or the machine spoilt a run: what was run is not what was asked for."""

    exit_code = 4


class CodecError(HilError):
    """A value that does not fit its signal, or a frame that is no message of ours."""
