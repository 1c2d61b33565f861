"""What both processes need around their loop: configuration file, log, signals, last words."""

from __future__ import annotations

import argparse
import json
import platform
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import FrameType, MappingProxyType
from typing import Any, NamedTuple

from drivers.recorder.client import NullRecorder, Recorder, Rotation
from hil import compiled
from hil.config.process import LogConfig
from hil.config.resolved import Resolved, read_resolved
from hil.errors import HilError, InterruptedRunError
from hil.log import topics
from hil.log.records import MESSAGE_HEAD
from hil.ports import Link
from hil.ports import Recorder as PortRecorder

_PACKAGES = ("fpeg-hil", "numpy", "mcap", "eclipse-zenoh", "python-can", "pydantic", "uvloop")
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
    """Open the log of a process, with all that a replay needs in it."""
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
        },
        "versions": versions(),
        **more,
    }
    attachments = [("scenario.json", "application/json", scenario.model_dump_json().encode())]
    if _DBC.exists():
        attachments.append(("fpeg.dbc", "text/plain", _DBC.read_bytes()))
    blocking = scenario.loop.clock == "lockstep"
    return Recorder.open(
        path, metadata, attachments, blocking=blocking, rotation=rotation_of(scenario.log)
    )


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
    """Set by SIGTERM or SIGINT; the loop looks at it between two ticks."""

    def __init__(self) -> None:
        self.requested = False
        self._at_once = False

    def listen(self) -> None:
        """Take over the two signals."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._request)

    def wait_for_peer(self, link: Link, timeout_s: float) -> None:
        """Wait for the peer; a request to end is followed at once.

        Raises: LinkError when it does not come within the time; KeyboardInterrupt
        """
        self._at_once = True
        try:
            link.wait_for_peer(timeout_s)
        finally:
            self._at_once = False

    def _request(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True
        if self._at_once:
            raise KeyboardInterrupt


def last_words(facts: Mapping[str, Any]) -> None:
    """Tell the starter how it went, as one JSON line."""
    print(json.dumps(facts), flush=True)


def guarded(main: Callable[[], int]) -> int:
    """Run a main function; a known failure is one line and its exit code, Ctrl-C too."""
    try:
        return main()
    except HilError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return InterruptedRunError.exit_code
