"""A PI step with frozen integral in saturation, once a stroke."""

from __future__ import annotations

from typing import NamedTuple

from hil.config.controller import Gains


class Terms(NamedTuple):
    """Output of a loop and its parts, for the log."""

    u: float
    p: float
    i: float


def pi_step(gains: Gains, integral: float, e: float, low: float, high: float) -> tuple[float, Terms]:
    """u = sat(kp e + I), I += ki e; I holds while u is saturated and e pushes further out.

    Parameters: low, high : limits of u relative to the operating point
    Returns: the new integral and the terms
    """
    moved = integral + gains.ki * e
    p = gains.kp * e
    wanted = p + moved
    u = min(max(wanted, low), high)
    if (wanted - u) * gains.ki * e > 0.0:
        moved = integral
        u = min(max(p + moved, low), high)
    return moved, Terms(u, p, moved)
