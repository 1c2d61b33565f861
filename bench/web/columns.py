"""Arrays on their way into a page: small, and exact to a step that no plot shows.

A column is whole steps from its first value on. Their differences as 32-bit numbers, least bytes
first and then the next ones, deflate to one or two bytes a value; `unpack` of plot.js reads them.
"""

from __future__ import annotations

import base64
import math
import zlib
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_MISSING: Final = -(2**31)
_MOST_STEPS: Final = 2.0e9
_FINE_STEPS: Final = 50_000
TIME_STEP_S: Final = 1e-6


class Columns:
    """The arrays of a page, each kept once."""

    def __init__(self) -> None:
        self._kept: dict[tuple[bytes, float], int] = {}
        self._heads: list[tuple[int, float, float]] = []
        self._bodies: list[bytes] = []

    def add(self, values: ArrayLike, step: float | None = None) -> int:
        """Take a column; returns its number.

        Parameters:
            values : shape (n,), a missing one is nan
            step : what it is exact to; if None, a part of the range of its values
        """
        column = np.asarray(values, dtype=np.float64)
        finite = column[np.isfinite(column)]
        least = float(finite.min()) if len(finite) else 0.0
        span = float(finite.max()) - least if len(finite) else 0.0
        step = max(step or _fine(span), span / _MOST_STEPS) or 1.0
        key = (column.tobytes(), step)
        if key not in self._kept:
            self._kept[key] = len(self._heads)
            self._heads.append((len(column), step, least))
            self._bodies.append(_packed(column, step, least))
        return self._kept[key]

    def packed(self) -> dict[str, Any]:
        """Return all of them as an object for JSON."""
        body = zlib.compress(b"".join(self._bodies), 9)
        return {"bytes": base64.b64encode(body).decode(), "columns": self._heads}


def _fine(span: float) -> float:
    """A round step that divides a span into some ten thousands."""
    return 10.0 ** math.floor(math.log10(span / _FINE_STEPS)) if span > 0.0 else 1.0


def _packed(column: NDArray[np.float64], step: float, origin: float) -> bytes:
    """Differences of steps as bytes, the least ones first."""
    steps = np.full(len(column), _MISSING, dtype=np.int64)
    finite = np.isfinite(column)
    steps[finite] = np.rint((column[finite] - origin) / step)
    differences = np.diff(steps, prepend=0).astype(np.int32)  # wraps, as the reader's sum does
    return differences.view(np.uint8).reshape(-1, 4).T.tobytes()
