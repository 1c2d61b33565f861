"""What the model-based laws believe of a stroke: one exact segment, calibrated on a steady state.

m z'' + c z' + k z = q f [(1 - h) + h (4/pi) sin(omega tau)],  k = k0 + k_q q,  omega^2 = k / m

in the direction of motion z, q the effective fuel of the charge, tau from its dead centre. Shape
h = 1 is the harmonic excitation (thesis eq. 5.54), h = 0 the rectangular one (eqs. 5.50, 5.52).
"""

from __future__ import annotations

import math
from typing import Final, final

from hil.roots import newton, secant
from hil.values import Value

_SINE: Final = 4.0 / math.pi
_SPAN_S: Final = 1e-7
_FLAT_S: Final = 2e-6
_LEAST_KG: Final = 0.1e-6
_CLOSE_KG: Final = 3e-10


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
class StrokeMap(Value):
    """Mass [kg], stiffness [N/m] and its rise per fuel, force per fuel [N/kg], shape, stroke [s].

    From any point of a stroke it tells where that ends, when, and which charge ends it at a target.

    fits: whether it meets the steady state in all three figures; else its timing is not relied on
    speed: actual mid-stroke speed over that of the map, in the steady state
    """

    __slots__ = ("m", "k0", "k_q", "f", "h", "stroke_s", "fits", "speed")

    def __init__(
        self, m: float, k0: float, k_q: float, f: float, h: float, stroke_s: float,
        fits: bool = True, speed: float = 1.0,
    ) -> None:  # fmt: skip
        self.m = m
        self.k0 = k0
        self.k_q = k_q
        self.f = f
        self.h = h
        self.stroke_s = stroke_s
        self.fits = fits
        self.speed = speed

    def with_mass(self, m: float) -> StrokeMap:
        """The map of another moving mass over the same springs."""
        return StrokeMap(m, self.k0, self.k_q, self.f, self.h, self.stroke_s, self.fits, self.speed)

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

    def pass_mid(self, q: float, c: float, start_m: float) -> tuple[float, float]:
        """Speed [m/s] at mid-stroke, and when [s], of a stroke from the distance `start_m`."""
        p = self.path(q, c, -start_m, 0.0, 0.0)

        def rising(s: float) -> tuple[float, float]:
            z, v = p.at(s)
            return z, max(v, 0.0)

        most = 0.2 * self.stroke_s
        s = newton(rising, 0.45 * self.stroke_s, low=_SPAN_S, most=most, close=_SPAN_S)
        return p.at(s)[1], s

    def end_of(self, q: float, c: float, start_m: float) -> float:
        """Distance at which a whole stroke from the distance `start_m` ends [m]."""
        return self.travel(q, c, -start_m, 0.0, 0.0)[0]

    def charge_for(self, c: float, start_m: float, target_m: float, guess_kg: float) -> float:
        """The effective fuel that ends the next stroke at the target [kg].

        By the secant rule; where more fuel seems to end it sooner, the last that did not.
        """
        q0 = max(guess_kg, _LEAST_KG)
        e0 = self.end_of(q0, c, start_m) - target_m
        q1 = q0 * 1.02
        for _ in range(5):
            e1 = self.end_of(q1, c, start_m) - target_m
            slope = (e1 - e0) / (q1 - q0)
            if slope <= 0.0:
                return q0
            q0, e0 = q1, e1
            q1 = min(max(q1 - e1 / slope, 0.3 * q1), 3.0 * q1)
            if abs(q1 - q0) < _CLOSE_KG:
                break
        return q1

    def load_behind(self, q: float, start_m: float, v_mid: float, guess_n_s_m: float) -> float:
        """The load coefficient that explains a mid-stroke speed [N s/m]."""
        return secant(
            lambda c: self.pass_mid(q, c, start_m)[0] - v_mid, max(guess_n_s_m, 1.0),
            steps=5, relative=1e-4,
        )  # fmt: skip

    def load_of_cycle(self, q: float, tdc_m: float, guess_n_s_m: float) -> float:
        """The load coefficient under which strokes on that fuel end where they begin [N s/m]."""
        return secant(
            lambda c: self.end_of(q, c, tdc_m) - tdc_m, max(guess_n_s_m, 1.0),
            steps=6, relative=1e-5,
        )  # fmt: skip
