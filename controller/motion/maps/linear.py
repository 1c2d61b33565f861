"""The map of the linear engines: one exact segment, calibrated on a steady state.

m z'' + c z' + k z = q f [(1 - h) + h (4/pi) sin(omega tau)],  k = k0 + k_q q,  omega^2 = k / m

in the direction of motion z, q the effective fuel of the charge, tau from its dead centre. Shape
h = 1 is the harmonic excitation (thesis eq. 5.54), h = 0 the rectangular one (eqs. 5.50, 5.52).
"""

from __future__ import annotations

import math
from typing import Final, final

from controller.motion.maps.stroke_map import Prediction, StrokeMap
from hil.roots import newton
from hil.values import Value

_SINE: Final = 4.0 / math.pi
_SPAN_S: Final = 1e-7
_FLAT_S: Final = 2e-6


@final
class Path(Value):
    """Coefficients of one solution, s counting from where it was begun."""

    __slots__ = ("decay", "omega_d", "y", "y_sine", "w", "w_sine", "centre", "g", "omega", "tau")

    def __init__(
        self, decay: float, omega_d: float, y: float, y_sine: float, w: float, w_sine: float,
        centre: float, g: float, omega: float, tau: float,
    ) -> None:  # fmt: skip
        self.decay = decay
        self.omega_d = omega_d
        self.y = y
        self.y_sine = y_sine
        self.w = w
        self.w_sine = w_sine
        self.centre = centre
        self.g = g
        self.omega = omega
        self.tau = tau

    def at(self, s: float) -> tuple[float, float]:
        """Position [m] and velocity [m/s] along the motion, s seconds on."""
        e = math.exp(-self.decay * s)
        angle, phase = self.omega_d * s, self.omega * (self.tau + s)
        cos, sin = e * math.cos(angle), e * math.sin(angle)
        z = self.centre + self.y * cos + self.y_sine * sin - self.g * math.cos(phase)
        return z, self.w * cos - self.w_sine * sin + self.g * self.omega * math.sin(phase)

    def slope(self, s: float, z: float, v: float) -> float:
        """Acceleration from the equation of motion itself [m/s2]."""
        pull = self.omega * self.omega * (self.centre - z) - 2.0 * self.decay * v
        phase = self.omega * (self.tau + s)
        return pull + 2.0 * self.decay * self.omega * self.g * math.sin(phase)


@final
class LinearMap(StrokeMap):
    """Mass [kg], stiffness [N/m] and its rise per fuel, force per fuel [N/kg], shape h."""

    def __init__(
        self, m: float, k0: float, k_q: float, f: float, h: float, stroke_s: float
    ) -> None:
        super().__init__(m, stroke_s)
        self.k0 = k0
        self.k_q = k_q
        self.f = f
        self.h = h

    def with_mass(self, m: float) -> LinearMap:
        """The map of another moving mass over the same springs."""
        return LinearMap(m, self.k0, self.k_q, self.f, self.h, self.stroke_s)

    def path(self, q: float, c: float, z: float, v: float, tau: float) -> Path:
        """Solve from (z, v) at tau on; damping beyond the oscillating kind is held below it."""
        m, k = self.m, self.k0 + self.k_q * q
        omega_sq = k / m
        omega = math.sqrt(omega_sq)
        decay = min(0.5 * max(c, 1.0) / m, 0.999 * omega)
        omega_d = math.sqrt(omega_sq - decay * decay)
        g = _SINE * self.h * self.f * q / (2.0 * m * decay * omega)
        centre = (1.0 - self.h) * self.f * q / k
        phase = omega * tau
        y = z - centre + g * math.cos(phase)
        w = v - g * omega * math.sin(phase)
        return Path(
            decay, omega_d, y, (w + decay * y) / omega_d, w, (decay * w + omega_sq * y) / omega_d,
            centre, g, omega, tau,
        )  # fmt: skip

    def push(self, q: float, tau: float) -> float:
        """Force of the charge per fuel, tau after its dead centre [N/kg]."""
        phase = math.sqrt((self.k0 + self.k_q * q) / self.m) * tau
        return self.f * (1.0 - self.h + self.h * _SINE * math.sin(phase))

    def travel(self, q: float, c: float, z: float, v: float, tau: float) -> tuple[float, float]:
        """Where and when the stroke under way ends: (distance [m], seconds from now)."""
        p = self.path(q, c, z, v, tau)
        # Of a free oscillation about the centre of pull; Newton's rule takes it from there.
        s = math.atan2(v, p.omega * (z - p.centre)) / p.omega if v > 0.0 else math.pi / p.omega_d
        most = 0.3 * self.stroke_s
        for _ in range(8):
            z, v = p.at(s)
            a = p.slope(s, z, v)
            step = min(max(v / a if a < 0.0 else -0.2 * self.stroke_s, -most), most)
            s = max(s - step, 0.0)
            if abs(step) < _FLAT_S:
                # The dead centre is flat in time: what is left of the step counts squared.
                return z - 0.5 * v * step, s
        return p.at(s)[0], s

    def reach(self, q: float, c: float, z: float, v: float, tau: float, position_m: float) -> float:
        """Seconds until the piston is at a position ahead, or at its dead centre before it."""
        end_m, left_s = self.travel(q, c, z, v, tau)
        if position_m >= end_m:
            return left_s
        p = self.path(q, c, z, v, tau)

        def short(s: float) -> tuple[float, float]:
            there, speed = p.at(s)
            return there - position_m, max(speed, 0.0)

        guess = left_s * max(1.0 - math.sqrt((end_m - position_m) / max(end_m - z, 1e-6)), 0.0)
        most = 0.2 * self.stroke_s
        return newton(short, guess, low=0.0, high=left_s, most=most, close=_SPAN_S)

    def pass_mid(self, q: float, c: float, start_m: float) -> tuple[float, float]:
        """Speed [m/s] at mid-stroke, and when [s], of a stroke from the distance `start_m`."""
        p = self.path(q, c, -start_m, 0.0, 0.0)

        def rising(s: float) -> tuple[float, float]:
            z, v = p.at(s)
            return z, max(v, 0.0)

        most = 0.2 * self.stroke_s
        s = newton(rising, 0.45 * self.stroke_s, low=_SPAN_S, most=most, close=_SPAN_S)
        return p.at(s)[1], s

    def speed_at(self, q: float, c: float, start_m: float, tau: float) -> float:
        """Velocity so long after the dead centre at the distance `start_m` [m/s]."""
        return self.path(q, c, -start_m, 0.0, 0.0).at(tau)[1]

    def predict(
        self, q: float, c: float, dt: float, z0: float, v0: float, z1: float, v1: float, tau: float
    ) -> Prediction:
        """The momentum: m v1 = m v0 + dt (q f(tau) - k z) - c (z1 - z0), z the mean on the way."""
        m = self.m
        middle = 0.5 * (z0 + z1) + dt * (v0 - v1) / 12.0
        push = self.push(q, tau - 0.5 * dt)
        a = (z0 - z1) / m
        b = dt / m * (push - self.k_q * middle)
        k = self.k0 + self.k_q * q
        return Prediction(v0 + dt / m * (push * q - k * middle) + a * c, a, b)
