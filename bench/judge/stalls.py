"""Stalls of a process, from its own times: not woken when it was due, or held up in its work."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.log import Log

BORNE_NS: Final = 9_000_000
"""A stall that is no longer is borne by the controller: its orders run ahead of the engine."""

NOTED_NS: Final = 4_000_000
"""A shorter one is no reason for anything."""

_MOST_KEPT: Final = 2000


class Stall(NamedTuple):
    """A process did not come to a tick in time, or not to its end.

    working: it had begun with the tick; by the clock alone that may have been its own doing
    """

    process: str
    tick: int
    t_ns: int
    late_ns: int
    working: bool

    @property
    def end_ns(self) -> int:
        """When it went on."""
        return self.t_ns + self.late_ns


def read_stalls(log: Log, process: str, period_ns: int) -> tuple[Stall, ...]:
    """Return the stalls of a process in order.

    A tick is due one period after the one before it, or once that one is done. What the plant does
    after its send is not in its work, so it is late for the next tick by it.
    """
    found: list[Stall] = []
    due_ns: int | None = None
    for block in log.blocks("/timing"):
        run = block[block["missed"] == 0]
        if not len(run) or len(found) >= _MOST_KEPT:
            continue
        found += _stalls_of(run, process, period_ns, due_ns)
        due_ns = int(_due_after(run[-1:], period_ns)[0])
    return tuple(found)


def _due_after(run: NDArray[Any], period_ns: int) -> NDArray[np.int64]:
    """When the tick after each of these is due [ns]."""
    next_ns = run["scheduled_ns"].astype(np.int64) + period_ns
    return np.maximum(next_ns, run["done_ns"].astype(np.int64))


def _stalls_of(run: NDArray[Any], process: str, period_ns: int, due_ns: int | None) -> list[Stall]:
    """Return the stalls of ticks in a row; `due_ns` is when the first of them was due.

    A controller's time begins when it comes to the first sample: how long that had waited is told
    by the tick that it came to soonest.
    """
    woke_ns = run["woke_ns"].astype(np.int64)
    scheduled_ns = run["scheduled_ns"].astype(np.int64)
    first_ns = int(scheduled_ns[0] + (woke_ns - scheduled_ns).min()) if due_ns is None else due_ns
    due = np.append(first_ns, _due_after(run[:-1], period_ns))
    waits_ns = woke_ns - due
    works_ns = run["done_ns"].astype(np.int64) - woke_ns
    found = []
    for late_ns, working in ((waits_ns, False), (works_ns, True)):
        for place in np.flatnonzero(late_ns >= NOTED_NS):
            begin_ns = int(woke_ns[place] if working else due[place])
            tick = int(run["tick"][place])
            found.append(Stall(process, tick, begin_ns, int(late_ns[place]), working))
    return sorted(found, key=lambda stall: stall.t_ns)
