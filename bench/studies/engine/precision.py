"""Work against precision: the fixed-step solver at several steps, beside scipy's solvers.

All integrate the same equations (kernel.rates of the plant) with the same located events, from
the same settled dead centre. The reference is DOP853 with a relative tolerance of 1e-11.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hil.config.detailed import read
from hil.errors import MissingExtraError, RunError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine, Motion, begin, engine_of, strokes
from plant.engines.detailed.kernel import pressure, rates
from plant.engines.detailed.settle import settle
from plant.engines.detailed.solver import advance, contact_position, due_position, happen, scratch
from plant.engines.detailed.solver import pressure_rate as slope_of_pressure
from plant.engines.detailed.types import Array

Rates = Callable[[float, Array], Array]
Crossing = Callable[[float, Array], float]

STEPS_S = (4.0e-4, 2.0e-4, 1.0e-4, 5.0e-5, 2.0e-5, 1.0e-5)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
STROKES = 8
_REFERENCE_STEP_S = 5.0e-4
_NEAR_M = 1.0e-12
_SCALE = {at.X: 1e-2, at.V: 1.0, at.U: 10.0, at.U + 2: 10.0, at.M: 1e-5, at.M + 2: 1e-5}


class Point(NamedTuple):
    """One run: what it cost, and how far it was from the reference."""

    method: str
    setting: float
    times_real_time: float
    tdc_error_m: float
    peak_error: float


def start(name: str) -> tuple[Engine, Motion]:
    """Return the engine at a left dead centre of settled running, sparks by position."""
    c = read(name)
    if c.cycle.kind == "motoring":
        raise RunError(f"{name}: a motored engine has no settled firing motion to measure")
    engine = engine_of(c)
    found = settle(c, c.heat.energy_j / c.heat.heating_value_j_kg,
                   c.machine.load_coefficient_n_s_m)  # fmt: skip
    motion = Motion(found.y.copy(), found.d.copy(), np.zeros((64, at.N_REC)))
    motion.d[at.ENERGY] = engine.energy_j
    begin(engine, motion, 1)
    return engine, motion


def fixed(engine: Engine, motion: Motion, step_s: float) -> tuple[Array, float]:
    """Run the compiled solver; returns the rows of the strokes and the wall time."""
    p = engine.p.copy()
    p[at.STEP_S] = step_s
    y, d, record = motion.y.copy(), motion.d.copy(), motion.record.copy()
    work = scratch()
    begun = time.process_time()
    while d[at.ROWS] < STROKES:
        advance(p, d, y, engine.programme, work, record, d[at.T] + 0.1, True)
    return strokes(Motion(y, d, record)), time.process_time() - begun


def adaptive(
    engine: Engine, motion: Motion, method: str, rtol: float, max_step_s: float = math.inf
) -> tuple[Array, float]:
    """Run one of scipy's solvers from event to event; returns rows and wall time."""
    try:
        from scipy.integrate import solve_ivp
    except ImportError:
        raise MissingExtraError("scipy", "detailed", "the comparison of solvers") from None
    p = engine.p
    y, d, record = motion.y.copy(), motion.d.copy(), motion.record.copy()
    work, out = scratch(), np.zeros(at.N_Y)
    atol = np.array([rtol * _SCALE.get(n, 1.0) for n in range(at.N_Y)])

    def f(t: float, state: Array) -> Array:
        rates(p, d, state, out, t)
        return out.copy()

    begun = time.process_time()
    while d[at.ROWS] < STROKES:
        _peaks(d, y, (y[:0], y[:0]), engine)
        events = _events(engine, d, f)
        if events[1](d[at.T], y) >= -_NEAR_M:  # a second entry at the position just reached
            happen(p, d, y, engine.programme, record, work, at.AT_POSITION)
            continue
        span = (d[at.T], d[at.T] + 0.1)
        options = {"method": method, "rtol": rtol, "atol": atol, "max_step": max_step_s}
        try:
            solution: Any = solve_ivp(f, span, y, events=events, **options)
        except ValueError as error:  # a trial step out of the cylinder
            line = f"{engine.calibration.name}: {method} with rtol {rtol:g} fails: {error}"
            raise RunError(line) from None
        y[:] = solution.y[:, -1]
        _peaks(d, y, (solution.y_events[2], solution.y_events[3]), engine)
        d[at.T] = solution.t[-1]
        if not solution.t_events[0].size and not solution.t_events[1].size:
            raise RunError("the reference solution found no event")
        what = at.DEAD_CENTRE if solution.t_events[0].size else at.AT_POSITION
        happen(p, d, y, engine.programme, record, work, what)
    return strokes(Motion(y, d, record)), time.process_time() - begun


def _events(engine: Engine, d: Array, f: Rates) -> list[Crossing]:
    """Terminal: dead centre, next position; not terminal: tops of both pressures."""
    direction = float(d[at.DIRECTION])
    target = due_position(d, engine.programme)
    wall = contact_position(engine.p, direction)
    target = min(target, wall) if direction > 0.0 else max(target, wall)

    def turned(t: float, y: Array) -> float:
        return float(y[at.V] * direction)

    def arrived(t: float, y: Array) -> float:
        return float((y[at.X] - target) * direction)

    def top(c: int) -> Crossing:
        def slope(t: float, y: Array) -> float:
            return float(slope_of_pressure(engine.p, y, f(t, y), c))

        slope.direction = -1  # type: ignore[attr-defined]
        return slope

    turned.terminal = arrived.terminal = True  # type: ignore[attr-defined]
    turned.direction, arrived.direction = -1, 1  # type: ignore[attr-defined]
    return [turned, arrived, top(0), top(1)]


def _peaks(d: Array, y: Array, tops: tuple[Array, Array], engine: Engine) -> None:
    """Keep the greatest pressure of each cylinder, at its tops and at the end."""
    for c in (0, 1):
        e = at.CYL + c * at.CYL_STRIDE
        for state in (*tops[c], y):
            d[e + at.P_MAX] = max(d[e + at.P_MAX], pressure(engine.p, state, c))


def compare(rows: Array, reference: Array) -> tuple[float, float]:
    """Greatest error of a dead centre [m], and of a peak pressure as a share.

    At a dead centre the peak of the other cylinder is complete.
    """
    tdc = np.abs(rows[:STROKES, at.REC_X] - reference[:STROKES, at.REC_X])
    column = np.where(reference[:STROKES, at.REC_X] > 0.0, at.REC_P_LEFT, at.REC_P_RIGHT)
    index = np.arange(STROKES)
    got, true = rows[index, column], reference[index, column]
    return float(tdc.max()), float(np.max(np.abs(got / true - 1.0)))


def measure(name: str, repeats: int = 5) -> list[Point]:
    """Measure all methods; of several repeats of the compiled one the fastest counts.

    A tolerance at which a solver steps over an event, or out of the cylinder, has no figures.
    """
    engine, motion = start(name)
    reference, _ = adaptive(engine, motion, "DOP853", 1e-11, _REFERENCE_STEP_S)
    lasted = float(reference[STROKES - 1, at.REC_T])
    points = []
    for step in STEPS_S:
        runs = [fixed(engine, motion, step) for _ in range(repeats)]
        wall = min(run[1] for run in runs)
        points.append(Point("fixed step", step, lasted / wall, *compare(runs[0][0], reference)))
    for method in ("LSODA", "RK45"):
        for rtol in TOLERANCES:
            try:
                rows, wall = adaptive(engine, motion, method, rtol)
            except RunError:
                points.append(Point(method, rtol, math.nan, math.nan, math.nan))
                continue
            points.append(Point(method, rtol, lasted / wall, *compare(rows, reference)))
    return points
