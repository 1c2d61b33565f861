"""Why a run did not end as it should, in one line, and what its logs still tell."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path

import hil.log
from bench.run.directory import RunFiles
from bench.run.processes import Child, End
from hil.errors import ConfigError, HilError, LogError, RunError

SAFE_STATES = {"safe-state", "mode safe"}
"""Codes of the events with which plant and controller say that they are in their safe state."""

_SPOKEN = {"loop": "plant and controller"}


def error_of(end: End, children: Sequence[Child], files: RunFiles) -> HilError | None:
    """Return the line that the user is told, None when all processes ended as they should."""
    if end.interrupted:
        return RunError(f"interrupted; logs: {files.directory}")
    culprit = end.culprit
    if culprit is None:
        return None
    if end.overdue:
        return RunError(f"{_who(culprit)} had to be ended; logs: {files.directory}")
    code = culprit.exit_code or 0
    if code < 0:
        others = [child.name for child in children if child is not culprit]
        told = f"{_who(culprit)} was killed by {signal.Signals(-code).name}"
        return RunError(f"{told}{_fate(culprit, others, files)}; logs: {files.directory}")
    return _failure(culprit, code, files)


def _who(child: Child) -> str:
    return f"{_SPOKEN.get(child.name, child.name)} (pid {child.pid})"


def _failure(culprit: Child, code: int, files: RunFiles) -> HilError:
    """Pass on the line of a process that ended by itself."""
    line = (culprit.errors.strip().splitlines() or [f"exit code {code}, no message"])[-1]
    if code == ConfigError.exit_code:
        for path in files.existing():  # no half a run where none could begin
            path.unlink()
        return ConfigError(line)
    if code == RunError.exit_code:
        return RunError(f"{culprit.name}: {line}; logs: {files.directory}")
    return RunError(f"{_who(culprit)} failed: {line}; details: {files.errors_of(culprit.name)}")


def _fate(culprit: Child, others: Sequence[str], files: RunFiles) -> str:
    """Say when a process was killed, and what became of the other one."""
    logs = {"plant": files.plant_log, "controller": files.controller_log}
    tick = last_tick(logs.get(culprit.name, files.plant_log))
    text = "" if tick is None else f" at tick {tick}"
    for name in others:
        safe = reached_safe_state(logs[name])
        text += f"; {name} {'reached its safe state' if safe else 'logged no safe state'}"
    return text


def last_tick(path: Path) -> int | None:
    """Return the last tick in a log, or None when it has none."""
    last = None
    try:
        with hil.log.open(path) as log:
            for block in log.blocks("/timing"):
                if len(block):
                    last = int(block["tick"][-1])
    except LogError:
        return None
    return last


def reached_safe_state(path: Path) -> bool:
    """Tell whether a process logged that it reached its safe state."""
    try:
        with hil.log.open(path) as log:
            return any(record.code in SAFE_STATES for record in log.records("/event"))
    except LogError:
        return False
