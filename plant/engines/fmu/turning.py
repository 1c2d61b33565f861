"""Dead centres between two samples of a motion, for units that do not tell theirs."""

from __future__ import annotations

import math


def turning_point(
    x0: float, v0: float, x1: float, v1: float, h: float
) -> tuple[float, float] | None:
    """Instant and position at which the velocity changes its sign, None when it does not.

    The motion is taken for the cubic with these positions and velocities at the step's ends:
    v(s) = v0 + (6d - 4v0 - 2v1) s + (3v0 + 3v1 - 6d) s^2, d = (x1 - x0)/h, s = t/h

    Returns: (time from the step's start [s], position [m])
    """
    if v0 * v1 >= 0.0:
        return None
    d = (x1 - x0) / h
    a, b = 3.0 * v0 + 3.0 * v1 - 6.0 * d, 6.0 * d - 4.0 * v0 - 2.0 * v1
    # The one root inside the step, in the form that loses no digits.
    q = -0.5 * (b + math.copysign(math.sqrt(max(b * b - 4.0 * a * v0, 0.0)), b))
    roots = [r for r in (q / a if a else math.inf, v0 / q if q else math.inf) if 0.0 <= r <= 1.0]
    s = roots[0] if roots else v0 / (v0 - v1)
    x = x0 + h * s * (v0 + s * (b / 2.0 + s * a / 3.0))
    return s * h, x
