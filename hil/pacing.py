"""When each tick runs: absolute deadlines in real time, no waiting in lockstep.

Tick k is due at start + k * period. A loop that comes late to its slot runs at once; slots that
have passed altogether are skipped and counted, so that there is never a backlog to catch up.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from hil.ports import Clock


class Slot(NamedTuple):
    """One turn of the loop; times are since the start of the run."""

    tick: int
    scheduled_ns: int
    woke_ns: int
    missed: int


class Pacer(Protocol):
    """What a shell asks for its next turn; the same in every mode.

    `patience_ns` is how long the shell waits for its peer within a turn: 0 where the peer's
    newest answer is taken if there is one, the peer timeout where the answer must come.
    """

    period_ns: int
    patience_ns: int

    def start(self, tick: int = 0) -> None:
        """Let the slot of this tick begin now."""

    def wait(self, tick: int) -> Slot:
        """Return when it is time for this tick, or with the tick that it is time for by now."""

    def now_ns(self) -> int:
        """Return the time since the start of the run [ns]."""


def next_slot(start_ns: int, period_ns: int, tick: int, now_ns: int) -> tuple[int, int]:
    """Return (tick to run, slots missed): the tick asked for, or the one in progress by now.

    start_ns, now_ns : int, on the same clock [ns]; period_ns : int, > 0 [ns]
    """
    missed = (now_ns - start_ns) // period_ns - tick
    return (tick + missed, missed) if missed > 0 else (tick, 0)


class RealTimePacer:
    """Absolute deadlines on a clock; the first `wait` starts it where `start` was not called."""

    __slots__ = ("_clock", "_start_ns", "patience_ns", "period_ns")

    def __init__(self, clock: Clock, period_ns: int, patience_ns: int = 0) -> None:
        self._clock = clock
        self._start_ns: int | None = None
        self.period_ns = period_ns
        self.patience_ns = patience_ns

    def start(self, tick: int = 0) -> None:
        """Let the slot of this tick begin now."""
        self._start_ns = self._clock.now_ns() - tick * self.period_ns

    def wait(self, tick: int) -> Slot:
        """Sleep to the tick's deadline; past its slot, return the slot in progress at once."""
        clock, period_ns = self._clock, self.period_ns
        if self._start_ns is None:
            self.start(tick)
        start_ns = self._start_ns or 0
        now_ns = clock.now_ns()
        run, missed = next_slot(start_ns, period_ns, tick, now_ns)
        scheduled_ns = run * period_ns
        if now_ns < start_ns + scheduled_ns:
            clock.sleep_until(start_ns + scheduled_ns)
            now_ns = clock.now_ns()
        return Slot(run, scheduled_ns, now_ns - start_ns, missed)

    def now_ns(self) -> int:
        """Return the time since tick 0 was due; 0 before the start [ns]."""
        return 0 if self._start_ns is None else self._clock.now_ns() - self._start_ns


class LockstepPacer:
    """Time is tick * period and nothing else; never waits."""

    __slots__ = ("_now_ns", "patience_ns", "period_ns")

    def __init__(self, period_ns: int, patience_ns: int = 0) -> None:
        self._now_ns = 0
        self.period_ns = period_ns
        self.patience_ns = patience_ns

    def start(self, tick: int = 0) -> None:
        """Let the slot of this tick begin now."""
        self._now_ns = tick * self.period_ns

    def wait(self, tick: int) -> Slot:
        """Return the slot of the tick at once."""
        self._now_ns = now_ns = tick * self.period_ns
        return Slot(tick, now_ns, now_ns, 0)

    def now_ns(self) -> int:
        """Return the instant of the tick in progress [ns]."""
        return self._now_ns
