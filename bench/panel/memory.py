"""The last minute of every topic at full rate, in arrays that are filled round and round."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil.log import topics

KEPT_S: Final = 60.0
_SELDOM: Final = 20_000
"""Rows kept of what does not come every tick: strokes of five minutes."""

_MOST: Final = 600_000
"""Rows kept of what comes every tick: all of the minute up to 10 kHz."""

Rows = NDArray[Any]


class Ring:
    """Rows of one topic; `count` counts all that ever came."""

    def __init__(self, dtype: np.dtype[Any], capacity: int) -> None:
        self._rows = np.zeros(capacity, dtype)
        self.count = 0

    def append(self, rows: Rows) -> None:
        """Take rows in; the oldest make room."""
        size = len(self._rows)
        kept = rows[-size:]
        start = (self.count + len(rows) - len(kept)) % size
        first = min(len(kept), size - start)
        self._rows[start : start + first] = kept[:first]
        self._rows[: len(kept) - first] = kept[first:]
        self.count += len(rows)

    def since(self, count: int) -> Rows:
        """Return the rows that came after the first `count`, as far as they are still there."""
        size = len(self._rows)
        new = min(self.count - count, size, self.count)
        if new <= 0:
            return self._rows[:0]
        start = (self.count - new) % size
        if start + new <= size:
            return self._rows[start : start + new]
        return np.concatenate([self._rows[start:], self._rows[: start + new - size]])


class Memory:
    """What both processes recorded in the last minute."""

    def __init__(self, rate_hz: int) -> None:
        self._ticks = min(max(int(rate_hz * KEPT_S), 1000), _MOST)
        self._rings: dict[str, Ring] = {}

    def append(self, key: str, rows: Rows) -> None:
        """Take in rows of a topic, named as its signals are: `plant.truth`."""
        ring = self._rings.get(key)
        if ring is None:
            seldom = f"/{key.partition('.')[2].replace('.', '/')}" in _RARE
            ring = self._rings[key] = Ring(rows.dtype, _SELDOM if seldom else self._ticks)
        ring.append(rows)

    def ring(self, key: str) -> Ring | None:
        """Return what there is of a topic; None before its first row."""
        return self._rings.get(key)

    def forget(self) -> None:
        """Begin again: another run, whose ticks count from nought."""
        self._rings.clear()


_RARE: Final = frozenset(topic.name for topic in topics.EVERY if topic.rate != "tick")
