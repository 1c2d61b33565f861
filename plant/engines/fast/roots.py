"""The instant at which a smooth function of time falls through zero."""

from __future__ import annotations

from collections.abc import Callable

TIME_TOLERANCE_S = 1.0e-14
_MAX_ITERATIONS = 100


def falling_zero(f: Callable[[float], tuple[float, float]], low: float, high: float) -> float:
    """Locate f(t) = 0 in (low, high], f positive behind `low` and not positive at `high`.

    Newton's rule, kept inside the bracket by bisection, to about 1e-14 s.

    Parameters: f : t [s] -> (value, slope)
    """
    t = high
    for _ in range(_MAX_ITERATIONS):
        value, slope = f(t)
        if value > 0.0:
            low = t
        else:
            high = t
        newton = t - value / slope if slope < 0.0 else low
        following = newton if low < newton < high else 0.5 * (low + high)
        if abs(following - t) <= TIME_TOLERANCE_S or high - low <= TIME_TOLERANCE_S:
            return following if following > low else high
        t = following
    return high
