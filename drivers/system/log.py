"""The log of a process: opened with all that a replay needs in it."""

from __future__ import annotations

import platform
import socket
import subprocess
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType

from drivers.recorder import tap
from drivers.recorder.client import (
    RING_BYTES,
    Attachment,
    NullRecorder,
    Recorder,
    Rotation,
    log_config,
)
from drivers.recorder.inline import InlineRecorder
from drivers.recorder.room import deferred_ring_bytes, ring_bytes
from drivers.zenoh.sockets import Side, guard_socket, records_socket
from hil import compiled
from hil.brought import ENGINES, LAWS, source_file
from hil.config.process import LogConfig
from hil.config.resolved import Resolved
from hil.errors import HilError
from hil.log.records import Topic
from hil.log.topics import ALL
from hil.names.own import law_topic

_PACKAGES = ("fpeg-hil", "numpy", "mcap", "eclipse-zenoh", "python-can", "pydantic", "uvloop")
_DBC = compiled.root() / "hil" / "wire" / "fpeg.dbc"


def open_recorder(
    path: Path | None,
    scenario: Resolved,
    process: str,
    more: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
    *,
    live: bool = False,
) -> Recorder | NullRecorder:
    """Open the log of a process, with all that a replay needs in it.

    Parameters: live : whether others may look on, see drivers/recorder/tap.py

    Raises: ConfigError when it cannot be written, or its ring finds no room in the memory
    """
    if path is None:
        return NullRecorder()
    metadata, attachments = _head(scenario, process)
    blocking = scenario.loop.clock == "lockstep"
    return Recorder.open(
        path, {**metadata, **more}, attachments, blocking=blocking,
        topics=topics_of(scenario, process),
        rotation=rotation_of(scenario.log), ring_bytes=_ring_bytes(scenario),
        deferred=scenario.log.defer, live=_listener(scenario, process) if live else None,
    )  # fmt: skip


def open_inline(path: Path, scenario: Resolved, process: str) -> InlineRecorder:
    """Open the same log to be written in this process: for runs in lockstep.

    Raises: ConfigError when it cannot be written
    """
    rotation = rotation_of(scenario.log)
    return InlineRecorder(
        path,
        log_config(
            path, *_head(scenario, process), topics_of(scenario, process), rotation=rotation
        ),
    )


def _head(
    scenario: Resolved, process: str
) -> tuple[dict[str, Mapping[str, str]], list[Attachment]]:
    """Metadata and attachments of a log: all that a replay needs."""
    run = {
        "process": process,
        "scenario": scenario.name,
        "seed": str(scenario.run.seed),
        "clock": scenario.loop.clock,
        "link": scenario.link.kind,
        "rate_hz": str(scenario.loop.rate_hz),
        **({"recording": "deferred to the end"} if scenario.log.defer else {}),
    }
    attachments = [("scenario.json", "application/json", scenario.model_dump_json().encode())]
    if _DBC.exists():
        attachments.append(("fpeg.dbc", "text/plain", _DBC.read_bytes()))
    attachments += [(path.name, "text/x-python", path.read_bytes()) for path in _brought(scenario)]
    return {"run": run, "versions": versions()}, attachments


def topics_of(scenario: Resolved, process: str) -> Sequence[Topic]:
    """Return the topics of a log; what a law of the user's own tells has the names that it says."""
    signals = scenario.controller.own.signals if process == "controller" else {}
    return (*ALL, law_topic(signals)) if signals else ALL


def _brought(scenario: Resolved) -> list[Path]:
    """Return the files of the law and the engine that the user has brought: kept to be read."""
    plant, controller = scenario.plant, scenario.controller
    sides = ((ENGINES, plant.model, plant.own), (LAWS, controller.name, controller.own))
    return [source_file(group, name, own.file) for group, name, own in sides if own.sha256]


def _listener(scenario: Resolved, process: str) -> socket.socket | None:
    """Where this recorder can be joined; None where that cannot be had, which is no fault."""
    try:
        side: Side = "plant" if process == "plant" else "controller"
        path = records_socket(scenario.link.zenoh, side, own=True)
        listener = tap.listen(path)
        if listener is not None:
            guard_socket(path)
    except (OSError, HilError):
        return None
    return listener


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


@lru_cache(maxsize=1)
def versions() -> Mapping[str, str]:
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
