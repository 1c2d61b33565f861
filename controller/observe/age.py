"""How old a sample is when its turn comes, by the clock: what has waited too long is not acted on.

The plant's tick is the only clock on the wire, so age is told from how much later than the earliest
one a sample is; the earliest is forgotten slowly, since two clocks drift.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.values import NEVER

_DRIFT: Final = 10_000
"""One part in so many, 100 ppm, by which the plant's clock may go more slowly than ours."""

_ANEW_NS: Final = 100_000_000
"""When all that comes has been too old for so long, it is the way that has become longer."""


@final
class SampleAge:
    """Tells the age of samples.

    most_ns: what is borne; NEVER where time does not pass by itself
    """

    def __init__(self, period_ns: i64, most_ns: i64) -> None:
        self.offset_ns: i64 = NEVER
        self._period_ns = period_ns
        self._drift_ns: i64 = max(period_ns // _DRIFT, 1)
        self.most_ns = most_ns
        self._old_since_ns: i64 = -1

    def is_too_old(self, tick: i64, now_ns: i64) -> bool:
        """Take note of a sample that is taken now, on our clock [ns]."""
        if self.most_ns >= NEVER:
            return False
        offset_ns = now_ns - tick * self._period_ns
        self.offset_ns = min(self.offset_ns + self._drift_ns, offset_ns)
        if offset_ns - self.offset_ns <= self.most_ns:
            self._old_since_ns = -1
            return False
        if self._old_since_ns < 0:
            self._old_since_ns = now_ns
        if now_ns - self._old_since_ns < _ANEW_NS:
            return True
        self.offset_ns, self._old_since_ns = offset_ns, -1
        return False

    def age_ns(self, tick: i64, now_ns: i64) -> i64:
        """Age of a sample beyond that of the youngest [ns]."""
        return now_ns - tick * self._period_ns - self.offset_ns

    def remember(self) -> tuple[int, int]:
        """Return all that the next answer depends on."""
        return self.offset_ns, self._old_since_ns

    def recall(self, memory: tuple[int, int]) -> None:
        """Go on from what `remember` returned."""
        self.offset_ns, self._old_since_ns = memory
