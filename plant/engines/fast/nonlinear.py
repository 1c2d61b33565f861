"""The engine with the full gas forces, integrated by a fixed formula with located stops.

m x'' = A [p_l(x) - p_r(x)] - c x' + F     (docs/model.md, eq. 14; thesis eqs. 5.21, 5.22)

with the exponent of 5.18 and 5.19 corrected to gamma.
"""

from __future__ import annotations

import math
from typing import Final, final

from hil.roots import falling_zero
from hil.values import Value
from plant.engines.fast.linear import CONTACT, DEAD_CENTRE, NO_STOP

# The gas force is unbounded at the head itself, so the piston counts as touching it here.
CONTACT_GAP_M: Final = 1.0e-4
# Step per metre of the nearer gap: the gas spring stiffens as 1/gap^(gamma + 1), see docs/model.md.
STEP_PER_GAP_S_M: Final = 0.020
MAX_STEP_S: Final = 5.0e-4
GAP_SHARE: Final = 0.25
MIN_STEP_S: Final = 1.0e-9
STEP_TOLERANCE_S: Final = 1.0e-13


@final
class GasPath(Value):
    """Coefficients of x'' = left (Ls+x)^-gamma - right (Ls-x)^-gamma - damping x' + push."""

    __slots__ = ("left", "right", "exponent", "damping", "push", "half_stroke_m")

    def __init__(
        self,
        left: float,
        right: float,
        exponent: float,
        damping: float,
        push: float,
        half_stroke_m: float,
    ) -> None:
        self.left = left
        self.right = right
        self.exponent = exponent
        self.damping = damping
        self.push = push
        self.half_stroke_m = half_stroke_m


def acceleration(path: GasPath, x: float, v: float) -> float:
    """Return x'' at (x, v)."""
    n, size = path.exponent, path.half_stroke_m
    a = path.left * math.pow(size + x, n) - path.right * math.pow(size - x, n)
    return a - path.damping * v + path.push


def rk4(path: GasPath, x: float, v: float, h: float) -> tuple[float, float]:
    """Advance (x, v) by h with the classical Runge-Kutta formula of order four."""
    left, right, n = path.left, path.right, path.exponent
    d, push, size = path.damping, path.push, path.half_stroke_m
    half = 0.5 * h
    a1 = left * math.pow(size + x, n) - right * math.pow(size - x, n) - d * v + push
    x2, v2 = x + half * v, v + half * a1
    a2 = left * math.pow(size + x2, n) - right * math.pow(size - x2, n) - d * v2 + push
    x3, v3 = x + half * v2, v + half * a2
    a3 = left * math.pow(size + x3, n) - right * math.pow(size - x3, n) - d * v3 + push
    x4, v4 = x + h * v3, v + h * a3
    a4 = left * math.pow(size + x4, n) - right * math.pow(size - x4, n) - d * v4 + push
    sixth = h / 6.0
    return x + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)


def advance(
    path: GasPath, x: float, v: float, dt: float, direction: int
) -> tuple[float, float, float, int]:
    """Move on by dt, or to the first dead centre or contact within it.

    Returns: (x, v, time used [s], NO_STOP | DEAD_CENTRE | CONTACT)
    """
    limit = path.half_stroke_m - CONTACT_GAP_M
    used = 0.0
    while used < dt:
        left = dt - used
        h = _step(path.half_stroke_m, x, v, left)
        x1, v1 = rk4(path, x, v, h)
        if v1 * direction <= 0.0:
            h = _dead_centre(path, x, v, h, direction)
            x1, v1 = rk4(path, x, v, h)
            if x1 * direction < limit:
                return x1, 0.0, used + h, DEAD_CENTRE
        if x1 * direction >= limit:
            h = _contact(path, x, v, h, limit * direction)
            return limit * direction, rk4(path, x, v, h)[1], used + h, CONTACT
        x, v = x1, v1
        used = dt if h == left else used + h
    return x, v, dt, NO_STOP


def _step(half_stroke_m: float, x: float, v: float, left: float) -> float:
    """Choose a step the local stiffness allows, that crosses a quarter of the gap at most."""
    gap = half_stroke_m - abs(x)
    h = min(STEP_PER_GAP_S_M * gap, MAX_STEP_S)
    if abs(v) * h > GAP_SHARE * gap:
        h = max(GAP_SHARE * gap / abs(v), MIN_STEP_S)
    if h >= left:
        return left
    # Two equal steps rather than a whole one and a crumb.
    return 0.5 * left if 2.0 * h > left else h


def _dead_centre(path: GasPath, x: float, v: float, high: float, direction: int) -> float:
    """Find h with v(h) = 0, h a step of the integrator's own."""

    def speed(h: float) -> tuple[float, float]:
        x1, v1 = rk4(path, x, v, h)
        return v1 * direction, acceleration(path, x1, v1) * direction

    return falling_zero(speed, 0.0, high, STEP_TOLERANCE_S)


def _contact(path: GasPath, x: float, v: float, high: float, limit_m: float) -> float:
    """Find h with x(h) at the contact position."""
    direction = 1 if limit_m > 0.0 else -1

    def gap(h: float) -> tuple[float, float]:
        x1, v1 = rk4(path, x, v, h)
        return (limit_m - x1) * direction, -v1 * direction

    return falling_zero(gap, 0.0, high, STEP_TOLERANCE_S)
