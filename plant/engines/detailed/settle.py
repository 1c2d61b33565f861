"""The settled motion of a detailed engine, as a state to begin with and as set points."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hil.config.detailed import Calibration, ideal, of_plant
from hil.config.plant import PlantConfig
from hil.errors import ConfigError, HilError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine, Motion, engine_of, running, strokes
from plant.engines.detailed.figures import compressed, has_winding
from plant.engines.detailed.solver import advance, scratch
from plant.engines.detailed.types import Array

_SETTLE_S = 2.5
_SAMPLE_S = 1.0e-4
_LONGEST_STROKE_S = 0.2


class EngineStopsError(ConfigError):
    """What is settled on keeps no engine running."""


class Settled(NamedTuple):
    """At a left dead centre, time 0; the charge of the left cylinder alight.

    spark_before_s: from the spark to the dead centre
    v_mid_m_s, stroke_s: speed at mid-stroke and duration of the power stroke that follows
    strokes_s, ends_m, speeds_m_s: of each stroke of a cycle from that one on, its duration, the
        distance of its dead centre, its speed at mid-stroke
    power_w: mean electric power of a cycle, positive when generating
    """

    y: Array
    d: Array
    tdc_m: float
    v_mid_m_s: float
    stroke_s: float
    spark_before_s: float
    strokes_s: tuple[float, ...]
    ends_m: tuple[float, ...]
    speeds_m_s: tuple[float, ...]
    power_w: float


def calibration_of(config: PlantConfig) -> Calibration:
    """Read the calibration of a plant's model and prototype.

    Raises: ConfigError when the pair has none, or takes no such figure
    """
    found = of_plant(config)
    return ideal(found) if config.ideal else found


def settle(c: Calibration, fuel_kg: float, load_n_s_m: float) -> Settled:
    """Run the engine with its sparks by position until it has settled, to a left dead centre.

    Raises: ConfigError when it stops or strikes a head
    """
    return _settle(c, fuel_kg, load_n_s_m)


@lru_cache(maxsize=32)
def _settle(c: Calibration, fuel_kg: float, load_n_s_m: float) -> Settled:
    kind = "two-stroke" if c.cycle.kind == "motoring" else c.cycle.kind
    tuned = c.model_copy(
        update={
            "heat": c.heat.model_copy(update={"energy_j": fuel_kg * c.heat.heating_value_j_kg}),
            "machine": c.machine.model_copy(update={"load_coefficient_n_s_m": load_n_s_m}),
            "cycle": c.cycle.model_copy(update={"kind": kind}),
        }
    )
    engine = engine_of(tuned)
    motion = running(engine)
    try:
        found = _last_cycle(engine, motion)
    except HilError:
        found = None
    if found is None or motion.d[at.CONTACTS] > 0:
        where = f"{c.name}: with {fuel_kg * 1e6:.4g} mg at {load_n_s_m:g} N s/m the engine"
        if found is None:
            raise EngineStopsError(f"{where} stops")
        raise ConfigError(f"{where} strikes a head")
    return found


def _last_cycle(engine: Engine, motion: Motion) -> Settled | None:
    """Follow the settled motion through one cycle more; None when it has stopped."""
    y, d, record = motion
    work = scratch()
    first_row = 2.0 if engine.calibration.cycle.kind == "four-stroke" else 0.0

    def to_dead_centre() -> bool:
        end = d[at.T] + _LONGEST_STROKE_S
        what = advance(engine.p, d, y, engine.programme, work, record, end, True)
        return bool(what == at.DEAD_CENTRE)

    end = d[at.T] + _SETTLE_S
    while d[at.T] < end or d[at.PHASE] != first_row:
        if not to_dead_centre():
            return None
    d[at.CONTACTS] = 0.0
    begun = d[at.T]
    before, speeds = y.copy(), []
    rows = engine.programme.shape[0]
    for _ in range(rows):
        copy = Motion(y.copy(), d.copy(), record.copy())
        speeds.append(_speed_at_mid_stroke(engine, copy))
        if not to_dead_centre():
            return None
    last = strokes(motion)[-rows:]
    ends_s = last[:, at.REC_T]
    strokes_s = tuple(float(s) for s in np.diff(ends_s, prepend=begun))
    ends_m = tuple(float(abs(x)) for x in last[:, at.REC_X])
    last = last[compressed(engine, last)]
    spark = d[at.T] - d[at.CYL + at.SPARK_T]
    power_w = _electric_j(engine, y - before) / float(d[at.T] - begun)
    tdc_m = float(np.mean(np.abs(last[:, at.REC_X])))
    zero, ways = _at_time_zero(y, d), (strokes_s, ends_m, tuple(speeds))
    return Settled(*zero, tdc_m, speeds[0], strokes_s[0], float(spark), *ways, power_w)


def _electric_j(engine: Engine, sums: Array) -> float:
    """What the machine has delivered: at its terminals if it has a winding, else on the mover."""
    if has_winding(engine):
        return -float(sums[at.W_TERMINAL])
    return float(sums[at.W_GENERATED] - sums[at.W_MOTORED])


def _at_time_zero(y: Array, d: Array) -> tuple[Array, Array]:
    """Count time and energies from this dead centre."""
    y, d = y.copy(), d.copy()
    now = d[at.T]
    d[at.T] = d[at.DC_T] = 0.0
    d[at.DC_NUMBER] = d[at.ROWS] = 0.0
    d[at.ENERGY] = 0.0
    for e in (at.CYL, at.CYL + at.CYL_STRIDE):
        if d[e + at.SPARK_T] < at.NEVER:
            d[e + at.SPARK_T] -= now
    y[at.SUM :] = 0.0
    return y, d


def _speed_at_mid_stroke(engine: Engine, motion: Motion) -> float:
    """Speed where x = 0 is first passed, between two close samples."""
    y, d, record = motion
    work, end = scratch(), d[at.T] + _LONGEST_STROKE_S
    while d[at.T] < end:
        x, v = y[at.X], y[at.V]
        advance(engine.p, d, y, engine.programme, work, record, d[at.T] + _SAMPLE_S, False)
        if (y[at.X] >= 0.0) != (x >= 0.0):
            share = x / (x - y[at.X])
            return float(abs(v + share * (y[at.V] - v)))
    return 0.0  # it turns before
