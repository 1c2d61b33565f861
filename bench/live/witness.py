"""What the machine did to a process, seen from outside: waits for a processor, stops.

A process that is late cannot know why. The kernel counts how long a thread was ready and not run
(/proc/PID/schedstat), and tells the parent of a process when that was stopped and goes on.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final

_LEAST_S: Final = 1e-3
_MOST_KEPT: Final = 1000


class Witness:
    """Looks at a process whenever it tells its status, and keeps what held it up in between."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._schedstat = Path(f"/proc/{pid}/schedstat")
        self._t_s = self._waited_s = 0.0
        self._waited_s = self._waits()
        self.held: list[dict[str, Any]] = []

    def look(self, t_s: float) -> None:
        """Note what has happened since the last look.

        Parameters: t_s : of the run, as the process told it [s]
        """
        waited_s, stopped = self._waits(), self._was_stopped()
        held_s = waited_s - self._waited_s
        if (held_s >= _LEAST_S or stopped) and len(self.held) < _MOST_KEPT:
            window = {"from_s": self._t_s, "to_s": t_s, "waited_s": round(held_s, 6)}
            self.held.append(window | {"stopped": stopped})
        self._t_s, self._waited_s = t_s, waited_s

    def _waits(self) -> float:
        """How long its main thread was ready and not run [s]."""
        try:
            return int(self._schedstat.read_text().split()[1]) * 1e-9
        except (OSError, IndexError, ValueError):  # it has ended, or this kernel does not count
            return self._waited_s

    def _was_stopped(self) -> bool:
        """Whether a signal has stopped it and another one let it go on."""
        try:
            return os.waitid(os.P_PID, self._pid, os.WCONTINUED | os.WNOHANG) is not None
        except OSError:
            return False
