"""Roots: a few steps from a good guess, or a search inside a bracket; the only ones there are."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

TIME_TOLERANCE_S: Final = 1.0e-14
MOST_ITERATIONS: Final = 100


def newton(
    f: Callable[[float], tuple[float, float]], x: float, *, low: float = -math.inf,
    high: float = math.inf, most: float = math.inf, close: float = 0.0, relative: float = 0.0,
    steps: int = 8,
) -> float:  # fmt: skip
    """Newton's rule on f(x) = 0 from the guess x.

    Parameters: f : x -> (value, slope), the slope 0 where it leads astray: then x moves on by
    `most`; low, high : range of x; most : longest step; close, relative : last step, and as a share
    """
    for _ in range(steps):
        value, slope = f(x)
        step = min(max(value / slope, -most), most) if slope else -most
        x = min(max(x - step, low), high)
        if abs(step) < close + relative * abs(x):
            break
    return x


def secant(f: Callable[[float], float], x0: float, *, steps: int, relative: float) -> float:
    """The secant rule on f(x) = 0 from the guess x0 > 0; a step goes to 0.3 to 3 times x.

    Parameters: relative : last step, as a share of x
    """
    e0, x1 = f(x0), x0 * 1.02
    for _ in range(steps):
        e1 = f(x1)
        if e1 == e0:
            break
        wanted = x1 - e1 * (x1 - x0) / (e1 - e0)
        x0, e0, x1 = x1, e1, min(max(wanted, 0.3 * x1), 3.0 * x1)
        if abs(x1 - x0) < relative * x0:
            break
    return x1


def falling_zero(
    f: Callable[[float], tuple[float, float]],
    low: float,
    high: float,
    tolerance: float = TIME_TOLERANCE_S,
) -> float:
    """Locate f(t) = 0 in (low, high], f positive behind `low` and not positive at `high`.

    Newton's rule, kept inside the bracket by bisection.

    Parameters: f : t [s] -> (value, slope)
    """
    t = high
    for _ in range(MOST_ITERATIONS):
        value, slope = f(t)
        if value > 0.0:
            low = t
        else:
            high = t
        newton = t - value / slope if slope < 0.0 else low
        following = newton if low < newton < high else 0.5 * (low + high)
        if abs(following - t) <= tolerance:
            return following if following > low else high
        t = following
    return high


def bisect(f: Callable[[float], float], low: float, high: float) -> float:
    """Find the zero of f in [low, high], f positive at low and not positive at high."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if f(middle) > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
