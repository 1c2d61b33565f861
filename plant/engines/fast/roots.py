"""Where a function falls through zero: by Newton's rule with its slope, or by halving without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

TIME_TOLERANCE_S: Final = 1.0e-14
MOST_ITERATIONS: Final = 100


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
