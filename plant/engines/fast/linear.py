"""The linear engine between two events, solved exactly.

m x'' + c x' + k x = F + F0 sin(omega tau)     (docs/model.md, eq. 10; thesis eqs. 5.50, 5.54)

with omega^2 = k/m of the same stroke. One evaluation gives position and velocity at any instant
of the segment, so nothing depends on the tick's length.
"""

from __future__ import annotations

import math
from typing import Final, final

from hil.roots import falling_zero
from hil.values import Value

NO_STOP: Final = 0
DEAD_CENTRE: Final = 1
CONTACT: Final = 2

UNDERDAMPED: Final = 0
CRITICAL: Final = 1
OVERDAMPED: Final = 2

# Below this load F0/(c omega) grows so large that its difference from the transient loses more
# digits than leaving the damping out of the forced part costs.
UNDAMPED_BELOW_N_S_M: Final = 1.0e-5
CRITICAL_BAND: Final = 1.0e-14


@final
class Segment(Value):
    """Coefficients of one exact solution: transient about `centre_m`, plus the forced part."""

    __slots__ = (
        "start_s", "decay", "omega_d", "regime", "y", "y_sine", "w", "w_sine", "centre_m", "omega",
        "g", "h", "omega_sq",
    )  # fmt: skip

    def __init__(
        self,
        start_s: float,
        decay: float,
        omega_d: float,
        regime: int,
        y: float,
        y_sine: float,
        w: float,
        w_sine: float,
        centre_m: float,
        omega: float,
        g: float,
        h: float,
        omega_sq: float,
    ) -> None:
        self.start_s = start_s
        self.decay = decay
        self.omega_d = omega_d
        self.regime = regime
        self.y = y
        self.y_sine = y_sine
        self.w = w
        self.w_sine = w_sine
        self.centre_m = centre_m
        self.omega = omega
        self.g = g
        self.h = h
        self.omega_sq = omega_sq


def segment(
    m: float,
    c: float,
    k: float,
    *,
    force_n: float,
    sine_n: float,
    x: float,
    v: float,
    tau: float,
) -> Segment:
    """Solve from (x, v) at tau on, tau from the dead centre.

    x_p = -(g + h tau) cos(omega tau), g = F0/(c omega) as in thesis eq. 5.60, or h = F0/(2 m omega)
    when undamped; the transient is eq. 5.82 with its constants corrected.
    """
    omega_sq = k / m
    omega = math.sqrt(omega_sq)
    damped = c > UNDAMPED_BELOW_N_S_M
    g = sine_n / (c * omega) if damped else 0.0
    h = 0.0 if damped else sine_n / (2.0 * m * omega)
    cos, sin = math.cos(omega * tau), math.sin(omega * tau)
    grown = g + h * tau
    y = x - force_n / k + grown * cos
    w = v - grown * omega * sin + h * cos
    decay = c / (2.0 * m)
    regime, omega_d = _regime(decay, omega_sq)
    scale = omega_d if omega_d > 0.0 else 1.0
    y_sine = (w + decay * y) / scale
    w_sine = (decay * w + omega_sq * y) / scale
    return Segment(
        start_s=tau, decay=decay, omega_d=omega_d, regime=regime, y=y, y_sine=y_sine, w=w,
        w_sine=w_sine, centre_m=force_n / k, omega=omega, g=g, h=h, omega_sq=omega_sq,
    )  # fmt: skip


def half_cosine(omega: float, x: float, x_end: float) -> Segment:
    """Go from rest at x to rest at x_end in pi/omega: thesis eq. 5.60 when x_end = -x."""
    centre = 0.5 * (x + x_end)
    y = x - centre
    return Segment(
        start_s=0.0, decay=0.0, omega_d=omega, regime=UNDERDAMPED, y=y, y_sine=0.0, w=0.0,
        w_sine=omega * y, centre_m=centre, omega=omega, g=0.0, h=0.0, omega_sq=omega * omega,
    )  # fmt: skip


def _regime(decay: float, omega_sq: float) -> tuple[int, float]:
    """Tell the kind of transient and its rate: omega_d, or sqrt(decay^2 - omega^2)."""
    rest = omega_sq - decay * decay
    if rest > CRITICAL_BAND * omega_sq:
        return UNDERDAMPED, math.sqrt(rest)
    if rest < -CRITICAL_BAND * omega_sq:
        return OVERDAMPED, math.sqrt(-rest)
    return CRITICAL, 0.0


def evaluate(path: Segment, tau: float) -> tuple[float, float]:
    """Return (x [m], v [m/s]) at tau."""
    s = tau - path.start_s
    if path.regime == UNDERDAMPED:
        phase = path.omega_d * s
        e = math.exp(-path.decay * s)
        cos = e * math.cos(phase)
        sin = e * math.sin(phase)
    else:
        cos, sin = _aperiodic(path, s)
    x = path.centre_m + path.y * cos + path.y_sine * sin
    v = path.w * cos - path.w_sine * sin
    g, h = path.g, path.h
    if g != 0.0 or h != 0.0:
        omega = path.omega
        phase = omega * tau
        cos = math.cos(phase)
        grown = g + h * tau
        x -= grown * cos
        v += grown * omega * math.sin(phase) - h * cos
    return x, v


def _aperiodic(path: Segment, s: float) -> tuple[float, float]:
    """Return e^(-decay s) times (cosh, sinh) of rate s, or (1, s) when critical."""
    decay, rate = path.decay, path.omega_d
    if path.regime == CRITICAL:
        e = math.exp(-decay * s)
        return e, e * s
    slow = math.exp((rate - decay) * s)
    fast = math.exp(-(rate + decay) * s)
    return 0.5 * (slow + fast), 0.5 * (slow - fast)


def acceleration(path: Segment, tau: float, x: float, v: float) -> float:
    """Return x'' from the equation of motion itself."""
    push = 2.0 * path.omega * (path.decay * path.g + path.h)
    forced = push * math.sin(path.omega * tau) if push else 0.0
    return path.omega_sq * (path.centre_m - x) - 2.0 * path.decay * v + forced


def advance(
    path: Segment, tau: float, dt: float, direction: int, limit_m: float
) -> tuple[float, float, float, int]:
    """Move on by dt, or to the first dead centre or contact within it.

    Returns: (x, v, time used [s], NO_STOP | DEAD_CENTRE | CONTACT)
    """
    end = tau + dt
    x, v = evaluate(path, end)
    stop = NO_STOP
    if v * direction <= 0.0:
        end = _dead_centre(path, tau, end, direction)
        x, v = evaluate(path, end)
        stop = DEAD_CENTRE
    if x * direction >= limit_m:
        end = _contact(path, tau, end, direction, limit_m)
        x, v = limit_m * direction, evaluate(path, end)[1]
        return x, v, end - tau, CONTACT
    return x, 0.0 if stop else v, end - tau, stop


def _dead_centre(path: Segment, low: float, high: float, direction: int) -> float:
    def speed(tau: float) -> tuple[float, float]:
        x, v = evaluate(path, tau)
        return v * direction, acceleration(path, tau, x, v) * direction

    return falling_zero(speed, low, high)


def _contact(path: Segment, low: float, high: float, direction: int, limit_m: float) -> float:
    def gap(tau: float) -> tuple[float, float]:
        x, v = evaluate(path, tau)
        return limit_m - x * direction, -v * direction

    return falling_zero(gap, low, high)
