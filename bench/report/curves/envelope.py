"""A signal over a whole run: every sample in chosen windows, least and greatest elsewhere.

What is drawn from every hundredth sample shows waves that are not there. Here a stretch is either
whole, or the range in which its samples lie.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.strokes import Floats
from hil.log import Log

MOST_FINE = 20_000
"""Samples at full rate in a report: those of twenty seconds at 1 kHz."""

_BINS = 1_200

Window = tuple[int, int]


class Trace(NamedTuple):
    """One signal: lines in the windows, with nan between them, and the range of each bin.

    t_s, y: shape (samples,); bin_t_s, low, high: shape (bins,), nan inside the windows
    """

    t_s: Floats
    y: Floats
    bin_t_s: Floats
    low: Floats
    high: Floats


def merged(wanted: Iterable[Window], end_ns: int, period_ns: int) -> list[Window]:
    """Return windows in order that do not overlap, as many as there is room for, the first first.

    A run that has room as a whole is one window.
    """
    if end_ns <= MOST_FINE * period_ns:
        return [(0, end_ns)]
    room, kept = MOST_FINE * period_ns, []
    for begin, end in wanted:
        low, high = max(begin, 0), min(end, end_ns)
        if 0 < high - low <= room:
            kept.append((low, high))
            room -= high - low
    joined: list[Window] = []
    for low, high in sorted(kept):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], high))
        else:
            joined.append((low, high))
    return joined


class _Gathering:
    """One signal in the making."""

    def __init__(self, end_ns: int) -> None:
        self.edges = np.linspace(0, end_ns + 1, _BINS + 1)
        self.low, self.high = np.full(_BINS, np.inf), np.full(_BINS, -np.inf)
        self.rows: list[NDArray[np.float64]] = []

    def take(self, t_ns: NDArray[Any], y: Floats, windows: Sequence[Window]) -> None:
        place = np.clip(np.searchsorted(self.edges, t_ns, side="right") - 1, 0, _BINS - 1)
        firsts = np.flatnonzero(np.diff(place, prepend=-1))
        bins = place[firsts]
        self.low[bins] = np.minimum(self.low[bins], np.minimum.reduceat(y, firsts))
        self.high[bins] = np.maximum(self.high[bins], np.maximum.reduceat(y, firsts))
        for low, high in windows:
            a, b = np.searchsorted(t_ns, (low, high + 1))
            if b > a:
                self.rows.append(np.stack([t_ns[a:b] * 1e-9, y[a:b]]))

    def trace(self, windows: Sequence[Window]) -> Trace:
        centres_ns = 0.5 * (self.edges[:-1] + self.edges[1:])
        outside = np.isfinite(self.low)
        for low, high in windows:
            outside &= (self.edges[1:] < low) | (self.edges[:-1] > high)
        low_y, high_y = (np.where(outside, v, np.nan) for v in (self.low, self.high))
        t_s, y = _joined(self.rows, [low * 1e-9 for low, _ in windows[1:]])
        if not outside.any():
            centres_ns = low_y = high_y = np.empty(0)
        return Trace(t_s, y, centres_ns * 1e-9, low_y, high_y)


def _joined(rows: list[NDArray[np.float64]], gaps_s: list[float]) -> tuple[Floats, Floats]:
    """Put the rows together, with a missing value where a window begins that does not follow on."""
    if not rows:
        return np.empty(0), np.empty(0)
    t_s, y = np.concatenate(rows, axis=1)
    at = np.unique(np.searchsorted(t_s, gaps_s))
    at = at[(at > 0) & (at < len(t_s))]
    return np.insert(t_s, at, t_s[at - 1]), np.insert(y, at, np.nan)


def gather(
    log: Log, topic: str, fields: Sequence[str], windows: Sequence[Window]
) -> dict[str, Trace]:
    """Read signals of one topic in one pass."""
    end_ns = max(log.end_ns, 1)
    found = {name: _Gathering(end_ns) for name in fields}
    if topic in log.topics:
        for block in log.blocks(topic):
            for name, gathering in found.items():
                gathering.take(block["t_ns"], block[name].astype(np.float64), windows)
    return {name: gathering.trace(windows) for name, gathering in found.items()}
