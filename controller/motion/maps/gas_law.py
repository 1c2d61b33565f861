"""The map of the gas law: two isentropes and the charge, integrated ahead.

m z'' = (S + B q) (L + z)^-gamma - S (L - z)^-gamma - c z'     (thesis eqs. 5.21, 5.22)

in the direction of motion z, with S = p0 A L^gamma and B q = (R/Cv) Hu q / CR^(gamma-1) L^(gamma-1)
what the charge adds to the isentrope behind the piston. By the formula of Runge and Kutta of order
four: some twenty steps a stroke, its end to 0.2 um and 1 us of one of infinitely many.
"""

from __future__ import annotations

import math
from typing import Final, final

from controller.motion.maps.stroke_map import Prediction, StrokeMap
from hil.values import Value

_STEP_SHARE: Final = 0.13
"""Of a steady stroke: the step in mid-stroke; it shrinks with the gap to the nearer head."""
_LONGEST_SHARE: Final = 0.087
_NEAREST: Final = 2.5e-3
"""Nearest that the piston is taken to a head, as a share of half the stroke."""
_MOST_STEPS: Final = 200
_FLAT_S: Final = 2e-6

_NODE: Final = 0.5 * math.sqrt(0.6)
_OUTER: Final = 5.0 / 18.0
_MIDDLE: Final = 8.0 / 18.0
"""Nodes and weights of Gauss's rule of three points on [0, 1]."""


@final
class GasPath(Value):
    """One stroke's coefficients of  z'' = behind (L + z)^-gamma - ahead (L - z)^-gamma - d z'."""

    __slots__ = ("behind", "ahead", "exponent", "d", "half_m", "nearest_m", "step_s_m", "most_s")

    def __init__(
        self, behind: float, ahead: float, exponent: float, d: float, half_m: float,
        nearest_m: float, step_s_m: float, most_s: float,
    ) -> None:  # fmt: skip
        self.behind = behind
        self.ahead = ahead
        self.exponent = exponent
        self.d = d
        self.half_m = half_m
        self.nearest_m = nearest_m
        self.step_s_m = step_s_m
        self.most_s = most_s

    def pull(self, z: float) -> float:
        """Acceleration by the gas alone [m/s2]."""
        n, least = self.exponent, self.nearest_m
        behind, ahead = max(self.half_m + z, least), max(self.half_m - z, least)
        return self.behind * math.pow(behind, n) - self.ahead * math.pow(ahead, n)

    def step_s(self, z: float) -> float:
        """A step that the stiffness at z allows [s]."""
        return min(self.step_s_m * max(self.half_m - abs(z), self.nearest_m), self.most_s)

    def moved(self, z: float, v: float, h: float) -> tuple[float, float]:
        """Position and velocity h later."""
        d, half = self.d, 0.5 * h
        a1 = self.pull(z) - d * v
        v2 = v + half * a1
        a2 = self.pull(z + half * v) - d * v2
        v3 = v + half * a2
        a3 = self.pull(z + half * v2) - d * v3
        v4 = v + h * a3
        a4 = self.pull(z + h * v3) - d * v4
        sixth = h / 6.0
        return z + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)

    def turn(self, z: float, v: float, h: float) -> tuple[float, float]:
        """The dead centre within h of (z, v): (distance [m], seconds from there).

        It is flat in time: what is left of the last step counts squared.
        """
        a = self.pull(z) - self.d * v
        s = min(v / -a, h) if a < 0.0 else 0.5 * h
        z1, v1 = z, v
        for _ in range(6):
            z1, v1 = self.moved(z, v, s)
            a = self.pull(z1) - self.d * v1
            if a >= 0.0:
                break
            step = v1 / a
            s = min(max(s - step, 0.0), h)
            if abs(step) < _FLAT_S:
                return z1 - 0.5 * v1 * step, s
        return z1, s

    def arrival(self, z: float, v: float, position_m: float) -> float:
        """Time from (z, v) to a position within a step of it [s]."""
        s = 0.0
        for _ in range(5):
            z1, v1 = self.moved(z, v, s)
            if v1 <= 0.0:
                return s
            step = (position_m - z1) / v1
            s += step
            if abs(step) < _FLAT_S:
                return s
        return s


@final
class GasMap(StrokeMap):
    """Mass [kg], S [N m^gamma] and B [N m^gamma/kg] of the equation, gamma, half the stroke [m]."""

    def __init__(
        self, m: float, spring: float, burn: float, gamma: float, half_m: float, stroke_s: float,
        speed: float = 1.0,
    ) -> None:  # fmt: skip
        super().__init__(m, stroke_s, speed, True)
        self.spring = spring
        self.burn = burn
        self.gamma = gamma
        self.half_m = half_m

    def with_mass(self, m: float) -> GasMap:
        """The map of another moving mass over the same springs."""
        return GasMap(m, self.spring, self.burn, self.gamma, self.half_m, self.stroke_s, self.speed)

    def path(self, q: float, c: float) -> GasPath:
        """The stroke of a charge under a load."""
        ahead = self.spring / self.m
        return GasPath(
            ahead + max(q, 0.0) * self.burn / self.m, ahead, -self.gamma, max(c, 0.0) / self.m,
            self.half_m, _NEAREST * self.half_m, _STEP_SHARE * self.stroke_s / self.half_m,
            _LONGEST_SHARE * self.stroke_s,
        )  # fmt: skip

    def travel(self, q: float, c: float, z: float, v: float, tau: float) -> tuple[float, float]:
        """Where and when the stroke under way ends: (distance [m], seconds from now)."""
        return self._until(q, c, z, v, self.half_m)

    def reach(self, q: float, c: float, z: float, v: float, tau: float, position_m: float) -> float:
        """Seconds until the piston is at a position ahead, or at its dead centre before it."""
        return self._until(q, c, z, v, position_m)[1]

    def _until(self, q: float, c: float, z: float, v: float, stop_m: float) -> tuple[float, float]:
        """Position and time of the dead centre, or of a position if that comes before it."""
        p = self.path(q, c)
        spent, longest = 0.0, 3.0 * self.stroke_s
        for _ in range(_MOST_STEPS):
            h = p.step_s(z)
            z1, v1 = p.moved(z, v, h)
            if v1 <= 0.0 or spent > longest:
                if v <= 0.0:  # pushed back from where it stands
                    return z, spent
                end_m, s = p.turn(z, v, h)
                if end_m > stop_m:
                    return stop_m, spent + p.arrival(z, v, stop_m)
                return end_m, spent + s
            if z1 > stop_m:
                return stop_m, spent + p.arrival(z, v, stop_m)
            z, v, spent = z1, v1, spent + h
        return z, spent

    def pass_mid(self, q: float, c: float, start_m: float) -> tuple[float, float]:
        """Speed [m/s] at mid-stroke, and when [s], of a stroke from the distance `start_m`."""
        p = self.path(q, c)
        z, v, spent, longest = -start_m, 0.0, 0.0, self.stroke_s
        while spent < longest:
            h = p.step_s(z)
            z1, v1 = p.moved(z, v, h)
            if z1 >= 0.0:
                break
            z, v, spent = z1, v1, spent + h
        if v <= 0.0:
            return 0.0, spent
        s = p.arrival(z, v, 0.0)
        return p.moved(z, v, s)[1], spent + s

    def speed_at(self, q: float, c: float, start_m: float, tau: float) -> float:
        """Velocity so long after the dead centre at the distance `start_m` [m/s]."""
        p = self.path(q, c)
        z, v, left = -start_m, 0.0, tau
        while left > 0.0:
            h = min(p.step_s(z), left)
            z, v = p.moved(z, v, h)
            left -= h
        return v

    def predict(
        self, q: float, c: float, dt: float, z0: float, v0: float, z1: float, v1: float, tau: float
    ) -> Prediction:
        """The momentum: m v1 = m v0 + integral of the gas force dt - c (z1 - z0).

        The force along the cubic through both positions and velocities, by Gauss's rule.
        """
        p = self.path(q, c)
        mean, push = 0.0, 0.0
        for node in range(3):
            s = 0.5 + _NODE * float(node - 1)
            weight = _MIDDLE if node == 1 else _OUTER
            r = 1.0 - s
            z = r * r * ((1.0 + 2.0 * s) * z0 + s * dt * v0) + s * s * (
                (1.0 + 2.0 * r) * z1 - r * dt * v1
            )
            gap = max(self.half_m + z, p.nearest_m)
            mean += weight * p.pull(z)
            push += weight * math.pow(gap, p.exponent)
        a = (z0 - z1) / self.m
        return Prediction(v0 + dt * mean + a * c, a, dt * push * self.burn / self.m)
