"""What the logs of a run that went wrong still tell."""

from __future__ import annotations

from pathlib import Path

import hil.log
from hil.errors import LogError

SAFE_STATES = {"safe-state", "mode safe"}
"""Codes of the events with which plant and controller say that they are in their safe state."""


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
