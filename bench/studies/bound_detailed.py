"""The physical bound on a detailed engine: exact deadbeat, by its compiled equations of motion.

The charge that is lit before a dead centre drives the stroke after it. At the dead centre before
that, the energy is sought with which that stroke ends at the set point under the loads that act.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

from bench.judge.response import Response
from bench.studies.bound import Informed
from hil.config.detailed import Calibration
from hil.errors import ConfigError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import RECORD_ROWS, Engine, engine_of
from plant.engines.detailed.settle import settle
from plant.engines.detailed.solver import advance, scratch
from plant.engines.detailed.types import Array

_RANGE: Final = (0.4, 1.8)
"""Of the energy of the settled charge: below it the engine stops, above it strikes a head."""

_LONGEST_S: Final = 0.2
_SECANT_STEPS: Final = 30
_CLOSE_M: Final = 1e-8


class Change(NamedTuple):
    """The load from an instant on, as a share of that before."""

    at_s: float
    scale: float


NO_CHANGE: Final = Change(math.inf, 1.0)


class Bench:
    """One engine to be tried out from any of its states.

    Parameters: advance_s : from the spark to the turn, in a stroke too short for the spark by
        position [s]
    """

    def __init__(self, engine: Engine, advance_s: float) -> None:
        import numpy as np

        self._engine = engine
        self._advance_s = advance_s
        self._work = scratch()
        self._record = np.zeros((RECORD_ROWS, at.N_REC))

    def stroke(self, y: Array, d: Array, energy_j: float, change: Change) -> bool:
        """Move on to the next dead centre, in place; False when there is none."""
        d[at.ENERGY] = energy_j
        y_then, d_then = y.copy(), d.copy()
        end_s = d[at.T] + _LONGEST_S
        if not self._move(y, d, end_s, change):
            return False
        ahead = at.CYL + (at.CYL_STRIDE if d_then[at.DIRECTION] > 0.0 else 0)
        if d_then[at.T] <= d[ahead + at.SPARK_T] <= d[at.T]:
            return True
        spark_s = d[at.T] - self._advance_s
        y[:], d[:] = y_then, d_then
        self._move(y, d, spark_s, change)
        d[ahead + at.SPARK_T], d[ahead + at.Q_IN] = spark_s, energy_j
        return self._move(y, d, end_s, change)

    def _move(self, y: Array, d: Array, until_s: float, change: Change) -> bool:
        """Move on to a dead centre, at the most until then; whether there was one."""
        if d[at.T] <= change.at_s <= until_s:
            if d[at.T] < change.at_s and self._advance(y, d, change.at_s):
                return True
            d[at.LOAD_SCALE] = change.scale
        return self._advance(y, d, until_s)

    def _advance(self, y: Array, d: Array, until_s: float) -> bool:
        engine = self._engine
        what = advance(engine.p, d, y, engine.programme, self._work, self._record, until_s, True)
        return bool(what == at.DEAD_CENTRE)

    def beyond(self, y: Array, d: Array, change: Change, target_m: float, energy_j: float) -> float:
        """How far beyond a target the stroke driven by that energy ends; without an end at 0."""
        y, d = y.copy(), d.copy()
        both = self.stroke(y, d, energy_j, change) and self.stroke(y, d, energy_j, change)
        return (abs(float(d[at.DC_X])) if both else 0.0) - target_m


def step_bound(
    calibration: Calibration, tdc_ref_m: float, fuel_kg: float, load_n_s_m: float, scale: float,
    fraction: float, knowledge: Informed = "full", *, advance_s: float = 1.5e-3, strokes: int = 12,
) -> Response:  # fmt: skip
    """The bound after a load step at a fraction of the undisturbed stroke.

    Parameters: fuel_kg : of the settled engine; advance_s : see `Bench`; knowledge : `full` or
    `mid-stroke`, as in `bench.studies.bound.bound`
    Raises: ConfigError when there is no settled motion, or the engine stops on the way
    """
    settled = settle(calibration, fuel_kg, load_n_s_m)
    joule = calibration.heat.heating_value_j_kg
    bench = Bench(engine_of(calibration), advance_s)
    y, d = settled.y.copy(), settled.d.copy()
    d[at.LOAD], d[at.LOAD_SCALE] = load_n_s_m, 1.0
    change = Change(fraction * settled.stroke_s, scale)
    limits = (_RANGE[0] * fuel_kg * joule, _RANGE[1] * fuel_kg * joule)
    times, errors, fuels = [], [], []
    for _ in range(strokes):
        known = change
        if knowledge == "mid-stroke" and d[at.T] + 0.5 * settled.stroke_s < change.at_s:
            known = NO_CHANGE
        energy = _deadbeat(partial(bench.beyond, y, d, known, tdc_ref_m), limits)
        if not bench.stroke(y, d, energy, change):
            raise ConfigError(f"{calibration.name}: the engine stops under {scale:g} of the load")
        times.append(float(d[at.T]) - change.at_s)
        errors.append((abs(float(d[at.DC_X])) - tdc_ref_m) * 1e3)
        fuels.append(energy / joule)
    return Response(tuple(times), tuple(errors), fuel_kg=tuple(fuels))


def _deadbeat(beyond: Callable[[float], float], limits: tuple[float, float]) -> float:
    """The energy at which `beyond` is nought, or the limit nearest to it (rule of Illinois)."""
    low, high = limits
    at_low, at_high = beyond(low), beyond(high)
    if at_low >= 0.0:
        return low
    if at_high <= 0.0:
        return high
    for _ in range(_SECANT_STEPS):
        energy = (low * at_high - high * at_low) / (at_high - at_low)
        found = beyond(energy)
        if abs(found) < _CLOSE_M:
            return energy
        if found < 0.0:
            low, at_low, at_high = energy, found, 0.5 * at_high
        else:
            high, at_high, at_low = energy, found, 0.5 * at_low
    return 0.5 * (low + high)
