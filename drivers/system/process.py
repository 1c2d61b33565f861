"""What both processes need around their loop: configuration file, log, signals, last words."""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType
from typing import Any, Final, NamedTuple, TextIO

from drivers.recorder.client import NullRecorder, Recorder
from drivers.system import starter
from hil import snapshot
from hil.config.base import Section
from hil.config.resolved import Resolved, read_resolved
from hil.errors import HilError, InterruptedRunError, RunError
from hil.log import topics
from hil.log.records import MESSAGE_HEAD
from hil.names.parameters import apply, parameters
from hil.ports import Link
from hil.ports import Recorder as PortRecorder
from hil.values import Value

_BRAKING_S: Final = 0.5


class Arguments(NamedTuple):
    """What a process is started with."""

    scenario: Resolved
    log: Path | None


def read_arguments(program: str, argv: list[str] | None = None) -> Arguments:
    """Read --config and --log.

    Raises: ConfigError naming file and key
    """
    parser = argparse.ArgumentParser(prog=program)
    parser.add_argument("--config", type=Path, required=True, help="scenario.json of a run")
    parser.add_argument("--log", type=Path, help="MCAP file to write")
    given = parser.parse_args(argv)
    return Arguments(read_resolved(given.config), given.log)


def rehearse(memory: Value, config: Section) -> None:
    """Do once what works out how when it is first asked: a snapshot, a change of no key.

    That takes milliseconds, which no tick has.
    """
    snapshot.dumps(memory)
    parameters()
    apply(config, {})


def note_granted(
    recorder: Recorder | NullRecorder, scenario: Resolved, granted: Mapping[str, str]
) -> None:
    """Log what the operating system granted; in lockstep it bears on nothing."""
    if scenario.loop.clock == "realtime":
        for name, text in granted.items():
            recorder.put(topics.EVENT.pack(0, 0, topics.INFO, "real-time", f"{name}: {text}"))


class NotingRecorder(PortRecorder):
    """Adds what the bus reported to the records of the tick in which it was read."""

    __slots__ = ("_link", "_put")

    def __init__(self, recorder: PortRecorder, link: Link) -> None:
        self._put = recorder.put
        self._link = link

    def put(self, data: bytes, /) -> None:
        """Hand over the records of one tick."""
        if notices := self._link.notices():
            _, _, _, tick, t_ns, *_ = MESSAGE_HEAD.unpack_from(data)
            for code, text in notices:
                data += topics.EVENT.pack(tick, t_ns, topics.WARNING, code, text)
        self._put(data)


def noting(recorder: PortRecorder, link: Link) -> PortRecorder:
    """Return a recorder that logs the reports of the link's bus too, if there is one."""
    return NotingRecorder(recorder, link) if link.reports() else recorder


class Stop:
    """A request to end; the loop looks at it between two ticks.

    cause: why nobody asked for it, in words; empty when SIGTERM or SIGINT did
    code: of the event that says so
    """

    def __init__(self) -> None:
        self.requested = False
        self.cause = ""
        self.code = ""
        self._at_once = False

    def listen(self) -> None:
        """Take over the signals, that of the starter's end too."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._request)
        if starter.pid() is not None or signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            signal.signal(signal.SIGHUP, self._left_alone)
        if starter.bind():
            self._left_alone()

    def end(self, code: str, cause: str) -> None:
        """Ask for the end because of what has happened."""
        self.code, self.cause = self.code or code, self.cause or cause
        self._request()

    def facts(self) -> dict[str, str]:
        """Return the cause for the summary, if there was one."""
        return {"cause": self.cause} if self.cause else {}

    def raise_if_caused(self) -> None:
        """A run that had to end did not end well.

        Raises: RunError
        """
        if self.cause:
            raise RunError(self.cause) from None

    def wait_for_peer(self, link: Link, timeout_s: float) -> None:
        """Wait for the peer; a request to end is followed at once.

        Raises: LinkError when it does not come within the time; KeyboardInterrupt; RunError when
            the starter is gone
        """
        try:
            self._at_once = True
            if self.requested:  # before anybody could follow it at once
                raise KeyboardInterrupt
            link.wait_for_peer(timeout_s)
        except KeyboardInterrupt:
            self.raise_if_caused()
            raise
        finally:
            self._at_once = False

    def _request(self, _number: int = 0, _frame: FrameType | None = None) -> None:
        self.requested = True
        if self._at_once:
            raise KeyboardInterrupt

    def _left_alone(self, _number: int = 0, _frame: FrameType | None = None) -> None:
        self.end(starter.LOST, starter.end_told())


def brake(
    stop: Stop, recorder: PortRecorder, tick: int, t_ns: int, turn: Callable[[], bool]
) -> None:
    """Log why it has to end, then take turns until one returns that the safe state is reached."""
    recorder.put(topics.EVENT.pack(tick, t_ns, topics.FAULT, stop.code, stop.cause))
    end_s = time.monotonic() + _BRAKING_S
    while not turn() and time.monotonic() < end_s:
        pass


def last_words(facts: Mapping[str, Any]) -> None:
    """Tell how it went: a person at a terminal in words, the program that started it in JSON."""
    say(sys.stdout, in_words(facts) if sys.stdout.isatty() else json.dumps(facts))


def in_words(facts: Mapping[str, Any]) -> str:
    """Return facts as lines; of a table of counters those that count something."""
    lines = []
    for name, fact in facts.items():
        counted = (
            (f"{key} {count}" for key, count in fact.items() if count)
            if isinstance(fact, Mapping)
            else (str(fact),)
        )
        lines.append(f"{name:<10} {', '.join(counted) or 'nothing'}".replace("_", " "))
    return "\n".join(lines)


def say(stream: TextIO, line: str) -> None:
    """Write one line; a reader that is gone is no reason to end otherwise than with one."""
    try:
        print(line, file=stream, flush=True)
    except OSError:  # what is left in the buffer must not fail once more at the very end
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def told_of(error: OSError | MemoryError) -> str:
    """Return in one line what the operating system refused."""
    if isinstance(error, MemoryError):
        return "out of memory"
    return f"{error.filename or 'operating system'}: {error.strerror or error}"


def guarded(main: Callable[[], int]) -> int:
    """Run a main function; a known failure is one line and its exit code, Ctrl-C too.

    What is not foreseen is told in full, and is no verdict either: exit code 3.
    """
    try:
        return main()
    except HilError as error:
        say(sys.stderr, str(error))
        return error.exit_code
    except KeyboardInterrupt:
        say(sys.stderr, "interrupted")
        return InterruptedRunError.exit_code
    except (OSError, MemoryError) as error:
        say(sys.stderr, told_of(error))
        return RunError.exit_code
    except Exception:  # the interpreter's own exit code would say "not met"
        say(sys.stderr, traceback.format_exc().rstrip())
        return RunError.exit_code
