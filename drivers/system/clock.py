"""The system's monotonic clock: sleeps most of the way, spins the rest."""

from __future__ import annotations

import os
import time

from drivers.polling import SHORT_NS, WakeUp
from hil.errors import ConfigError
from hil.ports import Clock

MAX_SPIN_S = 2e-3
SPIN_SHARE = 0.35
"""Of a period at the most: under SCHED_FIFO a loop that never sleeps starves its own recorder."""


class SystemClock(Clock):
    """CLOCK_MONOTONIC [ns].

    A sleeping thread wakes 20 to 100 us late, a spinning one within a microsecond; so a sleep ends
    as much ahead of the deadline as its wake-ups have been late, but no more than `spin_s` and a
    third of the period, and the rest is spun. Between looks at the clock the core is offered to
    threads of the same priority: those of a link that has threads of its own.

    Raises: ConfigError when spin_s is outside 0 to 2 ms
    """

    __slots__ = ("_wake_up",)

    def __init__(self, spin_s: float = 60e-6, period_ns: int | None = None) -> None:
        if not 0.0 <= spin_s <= MAX_SPIN_S:
            raise ConfigError(f"realtime.spin_s = {spin_s!r}: accepted 0 to {MAX_SPIN_S:g} s")
        spin_ns = round(spin_s * 1e9)
        most_ns = min(spin_ns, round(SPIN_SHARE * period_ns)) if period_ns else spin_ns
        self._wake_up = WakeUp(most_ns, period_ns or SHORT_NS)

    def now_ns(self) -> int:
        """Return the time on CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    def sleep_until(self, deadline_ns: int, /) -> None:
        """Return at or just after a time on CLOCK_MONOTONIC [ns]."""
        now, give_way, wake_up = time.monotonic_ns, os.sched_yield, self._wake_up
        until_ns = deadline_ns - wake_up.early_ns
        asleep_ns = until_ns - now()
        if asleep_ns > 0:
            time.sleep(asleep_ns * 1e-9)
            wake_up.woke(now() - until_ns)
        while now() < deadline_ns:
            give_way()
