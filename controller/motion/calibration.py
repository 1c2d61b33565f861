"""The stroke's map of a steady state: Newton's rule on TDC, duration and mid-stroke speed."""

from __future__ import annotations

import math
from typing import Final

from controller.knowledge import OperatingPoint
from controller.motion.stroke_map import StrokeMap
from hil.config.prototypes import Prototype
from hil.values import replace

_CALIBRATED: Final = 1e-7
_NUDGE: Final = 1e-5
_SHAPES: Final = (-0.5, 1.5)


def calibrate(
    engine: Prototype, tdc_m: float, load_n_s_m: float, point: OperatingPoint
) -> StrokeMap | None:
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
        v_mid, _ = believed.pass_mid(point.fuel_kg, load_n_s_m, tdc_m)
        return replace(believed, fits=False, speed=point.v_mid_m_s / v_mid)
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


def _map_of(engine: Prototype, u: list[float], point: OperatingPoint) -> StrokeMap:
    """The map of (ln force, ln stiffness, h); h is 1 when it is not among the unknowns."""
    size = engine.half_stroke_m
    force, stiff = math.exp(u[0]), math.exp(u[1])
    return StrokeMap(
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
    end, stroke_s = believed.travel(point.fuel_kg, load, -tdc_m, 0.0, 0.0)
    v_mid, _ = believed.pass_mid(point.fuel_kg, load, tdc_m)
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
