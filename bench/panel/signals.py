"""Signals as columns: those of the registry, and few that follow from a tick's times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.panel.memory import Rows
from hil.names import signals

LATE: Final = "late_us"
_DERIVED: Final = {
    f"{side}.timing.{LATE}": "woken after it was due" for side in ("plant", "controller")
}


class Source(NamedTuple):
    """Where a signal is: topic as a key of the memory, field, item of an array."""

    key: str
    field: str
    item: int | None


def sources() -> Mapping[str, Source]:
    """Return every signal that is a number, by its name."""
    found = {
        s.name: Source(f"{s.side}{s.topic.replace('/', '.')}", s.field, s.item)
        for s in signals.signals().values()
        if s.is_number
    }
    return found | {name: Source(name.rpartition(".")[0], LATE, None) for name in _DERIVED}


def listed() -> list[dict[str, str]]:
    """Return name, unit and meaning of every signal, as a page offers them."""
    known = sources()
    rows = [
        {"name": s.name, "unit": s.unit, "meaning": s.meaning}
        for s in signals.signals().values()
        if s.name in known
    ]
    return rows + [{"name": n, "unit": "us", "meaning": text} for n, text in _DERIVED.items()]


def columns(rows: Rows, wanted: list[Source]) -> NDArray[np.float64]:
    """Return times [s] and then each wanted signal, shape (1 + wanted, rows)."""
    found = np.empty((1 + len(wanted), len(rows)))
    found[0] = rows["t_ns"] * 1e-9
    for row, source in zip(found[1:], wanted, strict=True):
        row[:] = _values(rows, source)
    return found


def _values(rows: Rows, source: Source) -> Any:  # noqa: ANN401
    if source.field == LATE:
        return (rows["woke_ns"] - rows["scheduled_ns"]) * 1e-3
    values = rows[source.field]
    return values if source.item is None else values[:, source.item]


def thinned(found: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Return columns with at most so many instants, spikes kept: each bin's ends of every signal.

    Parameters: found : shape (1 + signals, rows)
    """
    count = found.shape[1]
    if count <= most:
        return found
    bins = max(most // 2, 1)
    edges = np.linspace(0, count, bins + 1).astype(np.intp)[:-1]
    thin = np.repeat(found[:, edges], 2, axis=1)
    thin[1:, 0::2] = np.minimum.reduceat(found[1:], edges, axis=1)
    thin[1:, 1::2] = np.maximum.reduceat(found[1:], edges, axis=1)
    return thin
