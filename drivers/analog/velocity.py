"""Velocity from positions alone: an oscillation through the newest of them.

x(t) = a + b cos(w t) + c sin(w t),   w = pi / T, T the time from one turn to the next

Least squares over the longest window that the resolution of the positions allows to be such a
curve, about the middle (a = 0) if that does: a long one averages the steps of an encoder, a short
one follows a charge that burns. Where the mover has turned, or positions are missing, the window
begins anew. The position is the curve's, too: the speed at mid-stroke is read off two positions and
two velocities, and a step of an encoder between two ticks alone is 10 mm/s.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

_SHORTEST, _LONGEST = 4, 11
_UNEXPLAINED: Final = 0.8
"""Of the resolution: what a position may lie beside a curve that explains it; half is rounding."""

_OTHER: Final = 0.003
"""Change of the frequency, as a share, from which the weights are worked out anew."""

_NEWEST: Final = 0.1
"""Weight of the newest stroke in the mean duration, once there have been ten."""

_Array = NDArray[np.float64]


class _Fit(NamedTuple):
    """Weights of position and slope at the newest of so many positions, and what it leaves."""

    length: int
    position: _Array
    slope: _Array
    left: _Array


class PositionVelocity:
    """Takes a position a tick; `push` returns position and velocity there.

    Parameters: resolution_m : least step of the positions
    """

    def __init__(self, period_s: float, resolution_m: float) -> None:
        self._period_s = period_s
        self._most_m = _UNEXPLAINED * resolution_m
        self._positions: deque[float] = deque(maxlen=_LONGEST)
        self._omega = 0.0
        self._fits: list[_Fit] = []
        self._since_turn = self._strokes = 0
        self._lasts = 0.0
        self._is_whole = False  # the stroke under way, from its turn on
        self._way = 0.0

    def push(self, x_m: float) -> tuple[float, float]:
        """Return position [m] and velocity [m/s]; nan until there are two, or after a nan."""
        if math.isnan(x_m):
            self._positions.clear()
            return x_m, x_m
        if self._positions:
            self._turn(x_m - self._positions[-1])
        self._positions.append(x_m)
        self._since_turn += 1
        count = len(self._positions)
        if count < 2:
            return x_m, math.nan
        if count < _SHORTEST or not self._omega:
            return x_m, (x_m - self._positions[-2]) / self._period_s
        return self._curve(np.array(self._positions))

    def _turn(self, step_m: float) -> None:
        """Begin anew where the mover has turned, and take the frequency from the stroke's time."""
        if step_m == 0.0 or step_m * self._way >= 0.0:
            self._way = step_m or self._way
            return
        self._way = step_m
        if self._is_whole and self._since_turn > _LONGEST:
            self._strokes += 1
            newest = max(1.0 / self._strokes, _NEWEST)
            self._lasts += newest * (self._since_turn * self._period_s - self._lasts)
            omega = math.pi / self._lasts
            if abs(omega - self._omega) > _OTHER * omega:
                self._omega = omega
                self._fits = self._all_fits()
        self._since_turn, self._is_whole = 0, True
        last = self._positions[-1]
        self._positions.clear()
        self._positions.append(last)

    def _all_fits(self) -> list[_Fit]:
        """The windows in the order in which they are tried: about the middle, then about any."""
        own = [self._fit(n, 1) for n in range(_LONGEST, _LONGEST - 4, -1)]
        return own + [self._fit(n, 0) for n in range(_LONGEST, _SHORTEST - 1, -1)]

    def _fit(self, count: int, first: int) -> _Fit:
        """Weights of so many positions; `first` column of 1, cos w t, sin w t that is used."""
        t = self._period_s * (np.arange(count) - (count - 1))
        whole = np.stack([np.ones(count), np.cos(self._omega * t), np.sin(self._omega * t)], axis=1)
        basis = whole[:, first:]
        inverse = np.linalg.pinv(basis)
        left = np.eye(count) - basis @ inverse
        return _Fit(count, basis[-1] @ inverse, self._omega * inverse[-1], left)

    def _curve(self, x: _Array) -> tuple[float, float]:
        """Position and slope by the first window that is explained, or by the shortest."""
        fit = self._fits[-1]
        for fit in self._fits:
            if fit.length <= len(x) and np.max(np.abs(fit.left @ x[-fit.length :])) <= self._most_m:
                break
        newest = x[-fit.length :]
        return float(fit.position @ newest), float(fit.slope @ newest)
