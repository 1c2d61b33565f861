"""How punctual the ticks were, from /timing, in constant memory."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.log import Log

_PER_DECADE = 200
_LOW_NS, _DECADES = 10.0, 10
_EDGES_NS = np.concatenate(
    [[0.0], _LOW_NS * 10.0 ** (np.arange(_PER_DECADE * _DECADES + 1) / _PER_DECADE)]
)
_AGES = 64
QUANTILES = {"p50": 0.5, "p99": 0.99, "p99_9": 0.999}

Counts = NDArray[np.int64]


class Histogram:
    """Counts of times in bins 1.2 % wide; the largest is kept exactly."""

    def __init__(self) -> None:
        self.counts: Counts = np.zeros(len(_EDGES_NS) - 1, dtype=np.int64)
        self.max_ns = 0

    def add(self, times_ns: NDArray[Any]) -> None:
        """Count the times of a block."""
        if not len(times_ns):
            return
        self.max_ns = max(self.max_ns, int(times_ns.max()))
        bounded = np.clip(times_ns, 0.0, _EDGES_NS[-1])
        self.counts += np.histogram(bounded, bins=_EDGES_NS)[0]

    @property
    def total(self) -> int:
        """How many times were counted."""
        return int(self.counts.sum())

    def quantile_ns(self, share: float) -> float | None:
        """Return the time that this share does not exceed, to the width of a bin."""
        total = self.total
        if not total:
            return None
        place = int(np.searchsorted(np.cumsum(self.counts), share * total))
        return min(float(_EDGES_NS[place + 1]), float(self.max_ns))

    def rebinned(self, per_decade: int, low_ns: float) -> tuple[NDArray[np.float64], Counts]:
        """Return edges [ns] and counts with fewer bins; what is shorter falls into the first."""
        edges = np.append(0.0, _EDGES_NS[1 :: _PER_DECADE // per_decade])
        edges = np.unique(np.append(edges[edges >= low_ns], 0.0))
        centres = 0.5 * (_EDGES_NS[:-1] + _EDGES_NS[1:])
        counts = np.histogram(centres, bins=edges, weights=self.counts)[0]
        return edges, counts.astype(np.int64)


class TickTiming(NamedTuple):
    """Punctuality of one process.

    late: woken after it was due; work: from waking to done; ages: ticks from the peer's frames
    to their use, counted (the last bin holds all beyond); without_peer: ticks that used none,
    after the first that did
    """

    ticks: int
    missed: int
    late: Histogram
    work: Histogram
    ages: Counts
    without_peer: int


def read_timing(log: Log, *, sample_driven: bool = False) -> TickTiming:
    """Gather the punctuality of a process.

    A process that is driven by samples has no deadline of its own: its lateness counts from the
    earliest phase at which a sample came.
    """
    origin_ns = earliest_ns(log) if sample_driven else 0
    late, work = Histogram(), Histogram()
    ages: Counts = np.zeros(_AGES, dtype=np.int64)
    ticks = missed = without = 0
    met_peer = False
    for block in log.blocks("/timing"):
        run = block[block["missed"] == 0]
        ticks += len(block)
        missed += len(block) - len(run)
        late.add(run["woke_ns"] - run["scheduled_ns"] - origin_ns)
        work.add(run["done_ns"] - run["woke_ns"])
        used = run["used_tick"]
        if not met_peer and len(first := np.flatnonzero(used >= 0)):
            met_peer = True
            run, used = run[first[0] :], used[first[0] :]
        if met_peer:
            age = (run["tick"].astype(np.int64) - used)[used >= 0]
            ages += np.bincount(np.clip(age, 0, _AGES - 1), minlength=_AGES)
            without += int((used < 0).sum())
    return TickTiming(ticks, missed, late, work, ages, without)


def earliest_ns(log: Log) -> int:
    """Return the least lateness of a run, which may be negative."""
    least = [
        int((run["woke_ns"] - run["scheduled_ns"]).min())
        for block in log.blocks("/timing")
        if len(run := block[block["missed"] == 0])
    ]
    return min(least, default=0)


def age_quantile(ages: Counts, share: float) -> int | None:
    """Return the age [ticks] that this share of the uses does not exceed."""
    total = int(ages.sum())
    if not total:
        return None
    return int(np.searchsorted(np.cumsum(ages), share * total))


def answered_share(timing: TickTiming) -> float | None:
    """Share of the plant's ticks that acted on the answer to the sample one tick before."""
    total = int(timing.ages.sum()) + timing.without_peer
    return float(timing.ages[1]) / total if total else None
