"""What the model-based laws believe of a stroke: one exact segment, calibrated on a steady state.

m z'' + c z' + k z = q f [(1 - h) + h (4/pi) sin(omega tau)],  k = k0 + k_q q,  omega^2 = k / m

in the direction of motion z, q the effective fuel of the charge, tau from its dead centre. Shape
h = 1 is the harmonic excitation (thesis eq. 5.54), h = 0 the rectangular one (eqs. 5.50, 5.52).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.knowledge import OperatingPoint
from hil.config.prototypes import Prototype

_SINE = 4.0 / math.pi
_SPAN_S = 1e-7
_CLOSE = 1e-9
_CALIBRATED = 1e-7
_NUDGE = 1e-5
_SHAPES = (-0.5, 1.5)


class EngineMap(NamedTuple):
    """Mass [kg], stiffness [N/m] and its rise per fuel, force per fuel [N/kg], shape, stroke [s].

    speed: actual mid-stroke speed over that of the map, in the steady state
    fits: whether it meets the steady state in all three figures; else its timing is not relied on
    """

    m: float
    k0: float
    k_q: float
    f: float
    h: float
    stroke_s: float
    fits: bool = True
    speed: float = 1.0


class Path(NamedTuple):
    """Coefficients of one solution, s counting from where it was begun."""

    decay: float
    omega_d: float
    y: float
    y_sine: float
    w: float
    w_sine: float
    centre: float
    g: float
    omega: float
    tau: float


def path(engine: EngineMap, q: float, c: float, z: float, v: float, tau: float) -> Path:
    """Solve from (z, v) at tau on; damping beyond the oscillating kind is held just below it."""
    k = engine.k0 + engine.k_q * q
    omega_sq = k / engine.m
    omega = math.sqrt(omega_sq)
    c = max(c, 1.0)
    decay = min(0.5 * c / engine.m, 0.999 * omega)
    omega_d = math.sqrt(omega_sq - decay * decay)
    g = _SINE * engine.h * engine.f * q / (2.0 * engine.m * decay * omega)
    centre = (1.0 - engine.h) * engine.f * q / k
    phase = omega * tau
    y = z - centre + g * math.cos(phase)
    w = v - g * omega * math.sin(phase)
    return Path(
        decay, omega_d, y, (w + decay * y) / omega_d, w, (decay * w + omega_sq * y) / omega_d,
        centre, g, omega, tau,
    )  # fmt: skip


def at(p: Path, s: float) -> tuple[float, float]:
    """Position [m] and velocity [m/s] along the motion, s seconds on."""
    decay, omega_d, y, y_sine, w, w_sine, centre, g, omega, tau = p
    e = math.exp(-decay * s)
    cos, sin = e * math.cos(omega_d * s), e * math.sin(omega_d * s)
    phase = omega * (tau + s)
    z = centre + y * cos + y_sine * sin - g * math.cos(phase)
    return z, w * cos - w_sine * sin + g * omega * math.sin(phase)


def _slope(p: Path, s: float, z: float, v: float) -> float:
    """Acceleration from the equation of motion itself [m/s2]."""
    pull = p.omega * p.omega * (p.centre - z) - 2.0 * p.decay * v
    return pull + 2.0 * p.decay * p.omega * p.g * math.sin(p.omega * (p.tau + s))


def travel(
    engine: EngineMap, q: float, c: float, z: float, v: float, tau: float
) -> tuple[float, float]:
    """Where and when the stroke under way ends: (distance [m], seconds from now)."""
    p = path(engine, q, c, z, v, tau)
    # Of a free oscillation about the centre of pull; Newton's rule takes it from there.
    s = math.atan2(v, p.omega * (z - p.centre)) / p.omega if v > 0.0 else math.pi / p.omega_d
    for _ in range(8):
        z, v = at(p, s)
        a = _slope(p, s, z, v)
        step = v / a if a < 0.0 else -0.2 * engine.stroke_s
        step = min(max(step, -0.3 * engine.stroke_s), 0.3 * engine.stroke_s)
        s = max(s - step, 0.0)
        if abs(step) < 2e-6:
            # The dead centre is flat in time: what is left of the step counts squared.
            return z - 0.5 * v * step, s
    return at(p, s)[0], s


def pass_mid(engine: EngineMap, q: float, c: float, start_m: float) -> tuple[float, float]:
    """Speed [m/s] at mid-stroke, and when [s], of a stroke from the distance `start_m`."""
    p = path(engine, q, c, -start_m, 0.0, 0.0)
    s = 0.45 * engine.stroke_s
    for _ in range(8):
        z, v = at(p, s)
        step = z / v if v > 0.0 else -0.2 * engine.stroke_s
        step = min(max(step, -0.2 * engine.stroke_s), 0.2 * engine.stroke_s)
        s = max(s - step, _SPAN_S)
        if abs(step) < _SPAN_S:
            break
    return at(p, s)[1], s


def end_of(engine: EngineMap, q: float, c: float, start_m: float) -> float:
    """Distance at which a whole stroke from the distance `start_m` ends [m]."""
    return travel(engine, q, c, -start_m, 0.0, 0.0)[0]


def charge_for(
    engine: EngineMap, c: float, start_m: float, target_m: float, guess_kg: float
) -> tuple[float, float]:
    """The effective fuel that ends the next stroke at the target, by the secant rule.

    Returns: (q [kg], dX/dq [m/kg])
    """
    q0 = max(guess_kg, 0.1e-6)
    e0 = end_of(engine, q0, c, start_m) - target_m
    q1 = q0 * 1.02
    slope = 1.0
    for _ in range(5):
        e1 = end_of(engine, q1, c, start_m) - target_m
        slope = (e1 - e0) / (q1 - q0)
        if slope <= 0.0:
            return q0, 3e3
        q0, e0 = q1, e1
        q1 = min(max(q1 - e1 / slope, 0.3 * q1), 3.0 * q1)
        if abs(q1 - q0) < _CLOSE * 0.3:
            break
    return q1, slope


def load_behind(
    engine: EngineMap, q: float, start_m: float, v_mid: float, guess_n_s_m: float
) -> float:
    """The load coefficient that explains a mid-stroke speed, by the secant rule [N s/m]."""
    c0 = max(guess_n_s_m, 1.0)
    e0 = pass_mid(engine, q, c0, start_m)[0] - v_mid
    c1 = c0 * 1.02
    for _ in range(5):
        e1 = pass_mid(engine, q, c1, start_m)[0] - v_mid
        if e1 == e0:
            break
        c2 = c1 - e1 * (c1 - c0) / (e1 - e0)
        c0, e0, c1 = c1, e1, min(max(c2, 0.3 * c1), 3.0 * c1)
        if abs(c1 - c0) < 1e-4 * c0:
            break
    return c1


def load_of_cycle(engine: EngineMap, q: float, tdc_m: float, guess_n_s_m: float) -> float:
    """The load coefficient under which strokes on that fuel end where they begin [N s/m]."""
    c0 = max(guess_n_s_m, 1.0)
    e0 = end_of(engine, q, c0, tdc_m) - tdc_m
    c1 = c0 * 1.02
    for _ in range(6):
        e1 = end_of(engine, q, c1, tdc_m) - tdc_m
        if e1 == e0:
            break
        c2 = c1 - e1 * (c1 - c0) / (e1 - e0)
        c0, e0, c1 = c1, e1, min(max(c2, 0.3 * c1), 3.0 * c1)
        if abs(c1 - c0) < 1e-5 * c0:
            break
    return c1


def calibrate(
    engine: Prototype, tdc_m: float, load_n_s_m: float, point: OperatingPoint
) -> EngineMap | None:
    """Shape, stiffness and force such that the steady state is the given one.

    Three unknowns (h, ln force, ln stiffness) from three figures (TDC, stroke, mid-stroke speed)
    by Newton's rule; of several solutions the one nearest to the prototype's figures. An engine
    of another kind has none: then h is 1 and mid-stroke speed is left out.

    Returns: None when the figures are no steady state of anything like this engine
    """
    if point.fuel_kg <= 0.0 or load_n_s_m <= 0.0:
        return None
    found = []
    for shape in (1.0, 0.0):
        u = _newton(engine, [0.0, 0.0, shape], tdc_m, load_n_s_m, point)
        if u is not None and _SHAPES[0] <= u[2] <= _SHAPES[1]:
            found.append(u)
    if not found:
        u = _newton(engine, [0.0, 0.0], tdc_m, load_n_s_m, point)
        if u is None:
            return None
        believed = _map_of(engine, u, point)
        v_mid, _ = pass_mid(believed, point.fuel_kg, load_n_s_m, tdc_m)
        return believed._replace(fits=False, speed=point.v_mid_m_s / v_mid)
    return _map_of(engine, min(found, key=lambda u: u[0] ** 2 + u[1] ** 2), point)


def _newton(
    engine: Prototype, u: list[float], tdc_m: float, load: float, point: OperatingPoint
) -> list[float] | None:
    """Solve as many of the misfits as there are unknowns (ln force, ln stiffness, perhaps h)."""
    size = len(u)
    for _ in range(20):
        e = _misfit(engine, u, tdc_m, load, point)[:size]
        if max(map(abs, e)) < _CALIBRATED:
            return u
        columns = []
        for i in range(size):
            moved = [x + _NUDGE * (i == j) for j, x in enumerate(u)]
            other = _misfit(engine, moved, tdc_m, load, point)[:size]
            columns.append([(b - a) / _NUDGE for a, b in zip(e, other, strict=True)])
        step = _solved(columns, e)
        if step is None:
            return None
        u = [x - min(max(dx, -0.3), 0.3) for x, dx in zip(u, step, strict=True)]
    return None


def _map_of(engine: Prototype, u: list[float], point: OperatingPoint) -> EngineMap:
    """The map of (ln force, ln stiffness, h); h is 1 when it is not among the unknowns."""
    size = engine.half_stroke_m
    force, stiff = math.exp(u[0]), math.exp(u[1])
    return EngineMap(
        engine.moving_mass_kg,
        stiff * engine.rest_stiffness_n_m,
        stiff * engine.gamma * engine.energy_j_kg / (size * size),
        force * engine.energy_j_kg / size,
        u[2] if len(u) > 2 else 1.0,
        point.stroke_s,
    )


def _misfit(
    engine: Prototype, u: list[float], tdc_m: float, load: float, point: OperatingPoint
) -> list[float]:
    """How far a stroke from the steady TDC is from ending there, in time, at the right speed."""
    believed = _map_of(engine, u, point)
    end, stroke_s = travel(believed, point.fuel_kg, load, -tdc_m, 0.0, 0.0)
    v_mid, _ = pass_mid(believed, point.fuel_kg, load, tdc_m)
    return [end / tdc_m - 1.0, stroke_s / point.stroke_s - 1.0, v_mid / point.v_mid_m_s - 1.0]


def _solved(columns: list[list[float]], e: list[float]) -> list[float] | None:
    """Cramer's rule for two or three equations; None when they do not tell the unknowns."""
    det = _det(columns)
    if abs(det) < 1e-9:
        return None
    size = len(e)
    swapped = ([*columns[:i], e, *columns[i + 1 :]] for i in range(size))
    return [_det(matrix) / det for matrix in swapped]


def _det(columns: list[list[float]]) -> float:
    """Determinant by its first column."""
    if len(columns) == 1:
        return columns[0][0]
    total, sign = 0.0, 1.0
    for i, value in enumerate(columns[0]):
        minor = [column[:i] + column[i + 1 :] for column in columns[1:]]
        total += sign * value * _det(minor)
        sign = -sign
    return total
