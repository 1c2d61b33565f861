"""How a link that is polled waits for its peer: what to sleep, when to yield, when to nap.

`take` is the link's own look for a batch: it returns the oldest one, or None at once.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Final

Take = Callable[[], bytes | None]

_AHEAD_NS: Final = 60_000  # how long before an expected arrival to stop sleeping, at the most
_AHEAD_SHARE: Final = 0.4  # and of a short period at most this, so that the loop does sleep
_YIELD_NS: Final = 150_000  # how long after it to go on yielding
_YIELD_LOCKSTEP_NS: Final = 50_000_000
_EARLIER_NS: Final = 5_000
_OVERSLEPT_MOST: Final = 5
_STEP_S: Final = 30e-6
_STEP_LOCKSTEP_S: Final = 200e-6
_LATER_NS: Final = 1_900
_SOONER_NS: Final = 100
_LEAST_NS: Final = 8_000
SHORT_NS: Final = 500_000
"""A shorter period has no room for a late wake-up: nothing is saved there."""


class WakeUp:
    """How long before a deadline to end a sleep: what 19 of 20 wake-ups need, learnt from them.

    A quantile by stochastic approximation: a wake-up that is later raises it by 19 parts, one that
    is not lowers it by one; so a stall of the machine moves it no more than any late one does.
    """

    __slots__ = ("_least_ns", "_most_ns", "early_ns")

    def __init__(self, most_ns: int, period_ns: int = SHORT_NS) -> None:
        self._least_ns = _LEAST_NS if period_ns >= SHORT_NS else most_ns
        self._most_ns = most_ns
        self.early_ns = most_ns

    def woke(self, late_ns: int) -> None:
        """Take note of how late a sleep ended [ns]."""
        early_ns = self.early_ns + (_LATER_NS if late_ns > self.early_ns else -_SOONER_NS)
        self.early_ns = min(max(early_ns, self._least_ns), self._most_ns)


class ArrivalClock:
    """When the next batch is due, learnt from those that came: the earliest phase, forgetting.

    due' = t + T - 7/8 max(d, 0), with d the lateness of the arrival at t, modulo the period T
    """

    __slots__ = ("_overslept", "due_ns", "period_ns")

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.due_ns = 0
        self._overslept = 0

    def arrived(self, now_ns: int) -> None:
        """Take note of an arrival; a lone late one hardly moves the phase."""
        late_ns = 0
        if self.due_ns:
            half_ns = self.period_ns // 2
            late_ns = (now_ns - self.due_ns + half_ns) % self.period_ns - half_ns
        self.due_ns = now_ns + self.period_ns - (late_ns * 7 // 8 if late_ns > 0 else 0)
        self._overslept = 0

    def missed(self, now_ns: int) -> None:
        """Look to the next arrival after nothing came."""
        behind_ns = now_ns - self.due_ns
        if self.due_ns and behind_ns > 0:
            self.due_ns += -(-behind_ns // self.period_ns) * self.period_ns

    def overslept(self) -> None:
        """Look a little sooner next time: what was waited for was there already.

        Several times in a row the peer is in another phase than was learnt: learn it anew.
        """
        self._overslept += 1
        again = self.period_ns >= SHORT_NS and self._overslept < _OVERSLEPT_MOST
        self.due_ns = self.due_ns + self.period_ns - _EARLIER_NS if again else 0


class LockstepPolling:
    """The answer comes as soon as the peer has worked it out: yield until then."""

    __slots__ = ("_take",)

    def __init__(self, take: Take) -> None:
        self._take = take

    def wait(self, timeout_ns: int) -> bytes | None:
        """Return the next batch, or None after the timeout [ns]."""
        now_ns = time.monotonic_ns()
        until_ns = now_ns + _YIELD_LOCKSTEP_NS
        return poll(self._take, until_ns, _STEP_LOCKSTEP_S, now_ns + timeout_ns)


class RealTimePolling:
    """Batches come once a period: sleep to shortly before the next, then yield, then nap."""

    __slots__ = ("_arrivals", "_take", "_wake_up")

    def __init__(self, take: Take, period_ns: int) -> None:
        self._take = take
        self._arrivals = ArrivalClock(period_ns)
        self._wake_up = WakeUp(min(_AHEAD_NS, round(_AHEAD_SHARE * period_ns)), period_ns)

    def wait(self, timeout_ns: int) -> bytes | None:
        """Return the next batch, or None after the timeout [ns]."""
        arrivals = self._arrivals
        now_ns = time.monotonic_ns()
        deadline_ns = now_ns + timeout_ns
        awake_ns = min(arrivals.due_ns - self._wake_up.early_ns, deadline_ns)
        if 0 < awake_ns - now_ns < arrivals.period_ns:
            time.sleep((awake_ns - now_ns) * 1e-9)
            self._wake_up.woke(time.monotonic_ns() - awake_ns)
            if (batch := self._take()) is not None:
                arrivals.overslept()
                return batch
        until_ns = max(now_ns, arrivals.due_ns) + _YIELD_NS
        batch = poll(self._take, until_ns, _STEP_S, deadline_ns)
        if batch is None:
            arrivals.missed(time.monotonic_ns())
        else:
            arrivals.arrived(time.monotonic_ns())
        return batch


def poll(take: Take, yield_until_ns: int, step_s: float, deadline_ns: int) -> bytes | None:
    """Poll, giving the core away between polls; later on sleep between them."""
    # The sleep lets in threads of lower priority too, should only the loop have SCHED_FIFO.
    now, give_way = time.monotonic_ns, os.sched_yield
    while True:
        batch = take()
        if batch is not None:
            return batch
        now_ns = now()
        if now_ns >= deadline_ns:
            return None
        if now_ns < yield_until_ns:
            give_way()
        else:
            time.sleep(min(step_s, (deadline_ns - now_ns) * 1e-9))
