"""When a campaign knows enough: an interval of confidence that is narrow enough, for every law.

The rule looks at the runs from the first to the end of a part, in their order and at instants that
follow from the campaign alone. So how many runs a campaign takes does not depend on how many
workers there were, nor on how often it was killed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from statistics import NormalDist
from typing import Any, Final, NamedTuple

from bench.studies.campaign.config import StopRule

GROWTH: Final = 1.1
"""So much more runs there must be at each look: who looks after every run believes chance."""


class Tally(NamedTuple):
    """Runs of a law, and the sum and sum of squares of what is asked for."""

    runs: int = 0
    total: float = 0.0
    squares: float = 0.0

    def plus(self, other: Tally) -> Tally:
        """Both together."""
        return Tally(self.runs + other.runs, self.total + other.total, self.squares + other.squares)


Tallies = Mapping[str, Tally]


def tallies(rule: StopRule, rows: Iterable[Mapping[str, Any]]) -> dict[str, Tally]:
    """Count the rows of each law; of a figure those that have one."""
    found: dict[str, Tally] = {}
    for row in rows:
        law, value = row["set_controller"], float(row[rule.figure])
        value = float(value > 0.0) if rule.is_share else value
        counted = Tally(1, value, value * value) if math.isfinite(value) else Tally()
        found[law] = found.get(law, Tally()).plus(counted)
    return found


def half_width(rule: StopRule, tally: Tally) -> float:
    """Half the interval of confidence of a share (Wilson) or of a mean (normal); inf before two.

    Wilson: z / (1 + z^2/n) sqrt(p (1 - p) / n + z^2 / (4 n^2));  mean: z s / sqrt(n)
    """
    n, z = tally.runs, NormalDist().inv_cdf(0.5 + 0.5 * rule.confidence)
    if n < 2:
        return math.inf
    mean = tally.total / n
    if rule.is_share:
        spread = mean * (1.0 - mean) / n + z * z / (4.0 * n * n)
        return z / (1.0 + z * z / n) * math.sqrt(max(spread, 0.0))
    variance = max(tally.squares - n * mean * mean, 0.0) / (n - 1)
    return z * math.sqrt(variance / n)


class Watch:
    """Takes the parts of a campaign in any order, and tells which is the last that is needed."""

    def __init__(self, rule: StopRule | None, laws: Iterable[str]) -> None:
        self.end: int | None = None
        """Parts that are enough; None as long as more are needed."""
        self._rule = rule
        self._sums = dict.fromkeys(laws, Tally())
        self._waiting: dict[int, Tallies] = {}
        self._next, self._look_at = 0, rule.least if rule is not None else math.inf

    def take(self, number: int, rows: Iterable[Mapping[str, Any]]) -> None:
        """Count a finished part."""
        if self._rule is None or self.end is not None:
            return
        self._waiting[number] = tallies(self._rule, rows)
        while self.end is None and (found := self._waiting.pop(self._next, None)) is not None:
            for law, tally in found.items():
                self._sums[law] = self._sums.get(law, Tally()).plus(tally)
            self._next += 1
            self._look(self._rule)

    def _look(self, rule: StopRule) -> None:
        """See whether the interval of every law is narrow enough, if it is time to look."""
        least = min(tally.runs for tally in self._sums.values())
        if least < self._look_at:
            return
        self._look_at = least * GROWTH
        if all(half_width(rule, tally) <= rule.half_width for tally in self._sums.values()):
            self.end = self._next

    def told(self) -> str:
        """What is known, a law after the other."""
        if self._rule is None:
            return ""
        rule = self._rule
        return ", ".join(
            f"{law} {tally.total / max(tally.runs, 1):.4g} +- {half_width(rule, tally):.2g}"
            for law, tally in self._sums.items()
        )
