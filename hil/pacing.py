"""When each tick runs: absolute deadlines in real time, no waiting in lockstep.

Tick k is due at start + k * period. A loop that comes late to its slot runs at once; slots that
have passed altogether are skipped and counted, so that there is never a backlog to catch up.
"""

from __future__ import annotations

from typing import final

from mypy_extensions import i64, mypyc_attr

from hil.ports import Clock
from hil.values import Value


@final
class Slot(Value):
    """One turn of the loop; times are since the start of the run."""

    __slots__ = ("tick", "scheduled_ns", "woke_ns", "missed")

    def __init__(self, tick: i64, scheduled_ns: i64, woke_ns: i64, missed: i64) -> None:
        self.tick = tick
        self.scheduled_ns = scheduled_ns
        self.woke_ns = woke_ns
        self.missed = missed


@mypyc_attr(allow_interpreted_subclasses=True)
class Pacer:
    """What a shell asks for its next turn; the same in every mode.

    `patience_ns` is how long the shell waits for its peer within a turn: 0 where the peer's
    newest answer is taken if there is one, the peer timeout where the answer must come.
    """

    __slots__ = ("patience_ns", "period_ns")

    def __init__(self, period_ns: i64, patience_ns: i64 = 0) -> None:
        self.period_ns = period_ns
        self.patience_ns = patience_ns

    def start(self, tick: i64 = 0) -> None:
        """Let the slot of this tick begin now."""

    def wait(self, tick: i64) -> Slot:
        """Return when it is time for this tick, or with the tick that it is time for by now."""
        raise NotImplementedError

    def now_ns(self) -> i64:
        """Return the time since the start of the run [ns]."""
        raise NotImplementedError


def next_slot(start_ns: i64, period_ns: i64, tick: i64, now_ns: i64) -> tuple[i64, i64]:
    """Return (tick to run, slots missed): the tick asked for, or the one in progress by now.

    start_ns, now_ns : int, on the same clock [ns]; period_ns : int, > 0 [ns]
    """
    missed = (now_ns - start_ns) // period_ns - tick
    return (tick + missed, missed) if missed > 0 else (tick, 0)


@final
class RealTimePacer(Pacer):
    """Absolute deadlines on a clock; the first `wait` starts it where `start` was not called."""

    __slots__ = ("_clock", "_start_ns", "_started")

    def __init__(self, clock: Clock, period_ns: i64, patience_ns: i64 = 0) -> None:
        super().__init__(period_ns, patience_ns)
        self._clock = clock
        self._start_ns: i64 = 0
        self._started = False

    def start(self, tick: i64 = 0) -> None:
        """Let the slot of this tick begin now."""
        self._start_ns = self._clock.now_ns() - tick * self.period_ns
        self._started = True

    def wait(self, tick: i64) -> Slot:
        """Sleep to the tick's deadline; past its slot, return the slot in progress at once."""
        clock, period_ns = self._clock, self.period_ns
        if not self._started:
            self.start(tick)
        start_ns = self._start_ns
        now_ns = clock.now_ns()
        run, missed = next_slot(start_ns, period_ns, tick, now_ns)
        scheduled_ns = run * period_ns
        if now_ns < start_ns + scheduled_ns:
            clock.sleep_until(start_ns + scheduled_ns)
            now_ns = clock.now_ns()
        return Slot(run, scheduled_ns, now_ns - start_ns, missed)

    def now_ns(self) -> i64:
        """Return the time since tick 0 was due; 0 before the start [ns]."""
        return self._clock.now_ns() - self._start_ns if self._started else 0


@final
class LockstepPacer(Pacer):
    """Time is tick * period and nothing else; never waits."""

    __slots__ = ("_now_ns",)

    def __init__(self, period_ns: i64, patience_ns: i64 = 0) -> None:
        super().__init__(period_ns, patience_ns)
        self._now_ns: i64 = 0

    def start(self, tick: i64 = 0) -> None:
        """Let the slot of this tick begin now."""
        self._now_ns = tick * self.period_ns

    def wait(self, tick: i64) -> Slot:
        """Return the slot of the tick at once."""
        self._now_ns = now_ns = tick * self.period_ns
        return Slot(tick, now_ns, now_ns, 0)

    def now_ns(self) -> i64:
        """Return the instant of the tick in progress [ns]."""
        return self._now_ns
