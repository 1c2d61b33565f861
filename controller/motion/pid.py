"""A PID step, once a stroke, whose integral is held while the output is saturated.

U(s) = (Kp + Ki / s + Kd s) E(s)     (thesis eqs. 6.3, 6.4), a stroke being the unit of time
"""

from __future__ import annotations

from typing import final

from hil.config.controller import Gains
from hil.values import Value


@final
class Terms(Value):
    """Output of a loop and its parts, for the log."""

    __slots__ = ("u", "p", "i", "d")

    def __init__(self, u: float, p: float, i: float, d: float) -> None:
        self.u = u
        self.p = p
        self.i = i
        self.d = d

    @property
    def pd(self) -> float:
        """What follows the error at once: proportional and derivative part."""
        return self.p + self.d


@final
class Loop(Value):
    """What a loop remembers: its integral, and the error of the stroke before."""

    __slots__ = ("integral", "e")

    def __init__(self, integral: float = 0.0, e: float = 0.0) -> None:
        self.integral = integral
        self.e = e


def pid_step(
    gains: Gains, loop: Loop, e: float, low: float, high: float, share: float = 1.0
) -> tuple[Loop, Terms]:
    """Apply u = sat(kp e + I + kd (e - e_before)), then I += ki e.

    The integral stays while u is saturated and e would push it further out.

    Parameters: low, high : limits of u relative to the operating point; share : of the gains
    Returns: the loop after this stroke, and the terms of this one
    """
    kp, ki, kd = share * gains.kp, share * gains.ki, share * gains.kd
    p, d = kp * e, kd * (e - loop.e)
    wanted = p + loop.integral + d
    u = min(max(wanted, low), high)
    held = (wanted - u) * ki * e > 0.0
    moved = loop.integral if held else loop.integral + ki * e
    return Loop(moved, e), Terms(u, p, loop.integral, d)
