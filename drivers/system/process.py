"""What both processes need around their loop: configuration file, log, signals, last words."""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import FrameType, MappingProxyType
from typing import Any, Final, NamedTuple, TextIO

from drivers.recorder.client import RING_BYTES, NullRecorder, Recorder, Rotation
from drivers.recorder.room import deferred_ring_bytes, ring_bytes
from drivers.system import starter
from hil import compiled
from hil.config.process import LogConfig
from hil.config.resolved import Resolved, read_resolved
from hil.errors import HilError, InterruptedRunError, RunError
from hil.log import topics
from hil.log.records import MESSAGE_HEAD
from hil.ports import Link
from hil.ports import Recorder as PortRecorder

_PACKAGES = ("fpeg-hil", "numpy", "mcap", "eclipse-zenoh", "python-can", "pydantic", "uvloop")
_BRAKING_S: Final = 0.5
_DBC = compiled.root() / "hil" / "wire" / "fpeg.dbc"


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


def open_recorder(
    path: Path | None,
    scenario: Resolved,
    process: str,
    more: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> Recorder | NullRecorder:
    """Open the log of a process, with all that a replay needs in it.

    Raises: ConfigError when it cannot be written, or its ring finds no room in the memory
    """
    if path is None:
        return NullRecorder()
    metadata = {
        "run": {
            "process": process,
            "scenario": scenario.name,
            "seed": str(scenario.run.seed),
            "clock": scenario.loop.clock,
            "link": scenario.link.kind,
            "rate_hz": str(scenario.loop.rate_hz),
            **({"recording": "deferred to the end"} if scenario.log.defer else {}),
        },
        "versions": versions(),
        **more,
    }
    attachments = [("scenario.json", "application/json", scenario.model_dump_json().encode())]
    if _DBC.exists():
        attachments.append(("fpeg.dbc", "text/plain", _DBC.read_bytes()))
    if scenario.controller.own.file:
        law = Path(scenario.controller.own.file)
        attachments.append((law.name, "text/x-python", law.read_bytes()))
    blocking = scenario.loop.clock == "lockstep"
    return Recorder.open(
        path, metadata, attachments, blocking=blocking, rotation=rotation_of(scenario.log),
        ring_bytes=_ring_bytes(scenario), deferred=scenario.log.defer,
    )  # fmt: skip


def _ring_bytes(scenario: Resolved) -> int:
    """A lockstep run waits when the ring is full; what runs in real time cannot."""
    rate_hz, duration_s = scenario.loop.rate_hz, scenario.run.duration_s
    if scenario.log.defer:
        return deferred_ring_bytes(rate_hz, duration_s)
    return RING_BYTES if scenario.loop.clock == "lockstep" else ring_bytes(rate_hz, duration_s)


def rotation_of(config: LogConfig) -> Rotation | None:
    """Return when a log goes on in another file; None: never."""
    size, time_s = config.segment_bytes, config.segment_s
    if size is None and time_s is None:
        return None
    return Rotation(size, None if time_s is None else round(time_s * 1e9), config.retain_bytes)


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


def versions() -> dict[str, str]:
    """Versions of this project, of what it stands on, and of the system."""
    found = {name: _version(name) for name in _PACKAGES}
    return {**found, "python": platform.python_version(), "system": platform.platform(),
            "git": git_hash()}  # fmt: skip


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def git_hash() -> str:
    """Commit of the checkout, with "-dirty" when it was changed; "unknown" outside of one."""
    try:
        found = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=12"],
            cwd=Path(__file__).parent, capture_output=True, text=True, timeout=5, check=True,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return found.stdout.strip()


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
    """Tell the starter how it went, as one JSON line; one that is gone does not hear it."""
    say(sys.stdout, json.dumps(facts))


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
