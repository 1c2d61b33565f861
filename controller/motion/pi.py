"""A PI step, once a stroke, whose integral is held while the output is saturated."""

from __future__ import annotations

from typing import final

from hil.config.controller import Gains
from hil.values import Value


@final
class Terms(Value):
    """Output of a loop and its parts, for the log."""

    __slots__ = ("u", "p", "i")

    def __init__(self, u: float, p: float, i: float) -> None:
        self.u = u
        self.p = p
        self.i = i


def pi_step(
    gains: Gains, integral: float, e: float, low: float, high: float
) -> tuple[float, Terms]:
    """Apply u = sat(kp e + I), then I += ki e unless u is saturated and e pushes further out.

    Parameters: low, high : limits of u relative to the operating point
    Returns: the next integral and the terms of this one
    """
    p = gains.kp * e
    wanted = p + integral
    u = min(max(wanted, low), high)
    moved = integral if (wanted - u) * gains.ki * e > 0.0 else integral + gains.ki * e
    return moved, Terms(u, p, integral)
