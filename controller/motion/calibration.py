"""The stroke's map of a steady state: Newton's rule on TDC, duration and mid-stroke speed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from controller.knowledge import OperatingPoint
from controller.motion.maps.gas_law import GasMap
from controller.motion.maps.linear import LinearMap
from controller.motion.maps.sensitivities import SensitivityMap, Table
from controller.motion.maps.stroke_map import StrokeMap
from hil.config.motion.stroke_map import StrokeMapConfig
from hil.config.prototypes import Prototype

_CALIBRATED: Final = 1e-7
_NUDGE: Final = 1e-5
_SHAPES: Final = (-0.5, 1.5)
_SAME_SPEED: Final = 2e-3
"""Of the mid-stroke speed: closer to that of the gas law an engine is taken to follow it."""

Unknowns = list[float]
Maker = Callable[[Unknowns], StrokeMap]


def calibrate(
    config: StrokeMapConfig, engine: Prototype, tdc_m: float, load_n_s_m: float,
    point: OperatingPoint,
) -> StrokeMap | None:  # fmt: skip
    """A map of the kind that is asked for such that the steady state is the given one.

    `auto` takes the linear map where one meets all three figures of the steady state, else the gas
    law where that does.

    Parameters: tdc_m : of the steady state
    Returns: None when the figures are no steady state of such an engine
    """
    if point.fuel_kg <= 0.0 or load_n_s_m <= 0.0:
        return None
    if config.kind == "gas-law":
        return gas_law(engine, tdc_m, load_n_s_m, point)
    if config.kind == "sensitivities":
        given = config.sensitivities
        return None if given is None else SensitivityMap(Table(given), given.mass_kg)
    found = linear(engine, tdc_m, load_n_s_m, point)
    if config.kind == "auto" and found is None:
        gas = gas_law(engine, tdc_m, load_n_s_m, point)
        if gas is not None and abs(gas.speed - 1.0) < _SAME_SPEED:
            return gas
    return found


def gas_law(
    engine: Prototype, tdc_m: float, load_n_s_m: float, point: OperatingPoint
) -> GasMap | None:
    """The gas law whose pressures meet TDC and duration; what it lacks in speed is kept as ratio.

    Two unknowns, ln pressure and ln energy, both nought where the engine has the prototype's own.
    """

    def make(u: Unknowns) -> GasMap:
        size, gamma = engine.half_stroke_m, engine.gamma
        return GasMap(
            engine.moving_mass_kg,
            math.exp(u[0]) * engine.p0_pa * engine.area_m2 * size**gamma,
            math.exp(u[1]) * engine.energy_j_kg * size ** (gamma - 1.0),
            gamma, size, point.stroke_s,
        )  # fmt: skip

    u = _newton(make, [0.0, 0.0], tdc_m, load_n_s_m, point)
    if u is None:
        return None
    found = make(u)
    v_mid, _ = found.pass_mid(point.fuel_kg, load_n_s_m, tdc_m)
    found.speed = point.v_mid_m_s / v_mid
    return found


def linear(
    engine: Prototype, tdc_m: float, load_n_s_m: float, point: OperatingPoint
) -> LinearMap | None:
    """Shape, stiffness and force of a linear engine.

    Three unknowns (h, ln force, ln stiffness) from three figures (TDC, stroke, mid-stroke speed)
    by Newton's rule; of several solutions the one nearest to the prototype's figures. An engine
    of another kind has none.
    """

    def make(u: Unknowns) -> LinearMap:
        return _linear_of(engine, u, point)

    found = []
    for shape in (1.0, 0.0):
        u = _newton(make, [0.0, 0.0, shape], tdc_m, load_n_s_m, point)
        if u is not None and _SHAPES[0] <= u[2] <= _SHAPES[1]:
            found.append(u)
    return make(min(found, key=lambda u: u[0] ** 2 + u[1] ** 2)) if found else None


def _newton(
    make: Maker, u: Unknowns, tdc_m: float, load: float, point: OperatingPoint
) -> Unknowns | None:
    """Solve as many of the misfits as there are unknowns."""
    size = len(u)
    for _ in range(20):
        e = _misfit(make(u), tdc_m, load, point)[:size]
        if max(map(abs, e)) < _CALIBRATED:
            return u
        columns = []
        for i in range(size):
            moved = [x + _NUDGE * (i == j) for j, x in enumerate(u)]
            other = _misfit(make(moved), tdc_m, load, point)[:size]
            columns.append([(b - a) / _NUDGE for a, b in zip(e, other, strict=True)])
        step = _solved(columns, e)
        if step is None:
            return None
        u = [x - min(max(dx, -0.3), 0.3) for x, dx in zip(u, step, strict=True)]
    return None


def _linear_of(engine: Prototype, u: Unknowns, point: OperatingPoint) -> LinearMap:
    """The map of (ln force, ln stiffness, h)."""
    size = engine.half_stroke_m
    force, stiff = math.exp(u[0]), math.exp(u[1])
    return LinearMap(
        engine.moving_mass_kg,
        stiff * engine.rest_stiffness_n_m,
        stiff * engine.gamma * engine.energy_j_kg / (size * size),
        force * engine.energy_j_kg / size,
        u[2],
        point.stroke_s,
    )


def _misfit(believed: StrokeMap, tdc_m: float, load: float, point: OperatingPoint) -> list[float]:
    """How far a stroke from the steady TDC is from ending there, in time, at the right speed."""
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
