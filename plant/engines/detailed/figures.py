"""Figures of settled running: the thesis's Table 4.3 and Table 2 of its Appendix I."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.errors import RunError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine, Motion, run_for, running, strokes
from plant.engines.detailed.types import Array

_J_PER_KWH = 3.6e6


class Figures(NamedTuple):
    """Means over the last cycles of a settled run.

    speed_rpm: oscillations a minute (thesis section 4.2: equivalent crankshaft speed)
    electric_w: P_e = P_i - P_f - P_c, P_c the motor's power whether it drives or brakes (4.1, 4.2);
        of a machine with a winding that at its terminals, of an engine held at a speed what the
        drive takes
    copper_w: heat of that winding, taken off before its terminals
    compression_ratio: effective, from the closing of the last valve to the dead centre
    fuel_kg_kwh: for the indicated work
    """

    speed_rpm: float
    v_max_m_s: float
    v_mean_m_s: float
    p_max_pa: float
    compression_ratio: float
    tdc_m: float
    indicated_w: float
    electric_w: float
    motoring_w: float
    friction_w: float
    heat_w: float
    exhaust_w: float
    leak_w: float
    pump_w: float
    copper_w: float
    fuel_w: float
    efficiency: float
    fuel_kg_kwh: float


def settled(engine: Engine, seconds: float = 4.0, motion: Motion | None = None) -> Motion:
    """Run until the motion has settled.

    Raises: RunError when the engine has stopped
    """
    motion = run_for(engine, running(engine) if motion is None else motion, seconds)
    rows = strokes(motion)
    if len(rows) < 16 or motion.d[at.T] - rows[-1, at.REC_T] > 0.2:
        raise RunError(f"{engine.calibration.name}: the engine stops at these settings")
    return motion


def cycle_rows(engine: Engine, motion: Motion, cycles: int = 10) -> Array:
    """Rows of the record from the start of one cycle to the end of the last."""
    rows = strokes(motion)
    length = engine.programme.shape[0]
    ends = np.flatnonzero(rows[:, at.REC_PHASE] == length - 1)
    count = min(cycles, len(ends) - 1)
    part: Array = rows[ends[-1 - count] : ends[-1] + 1]
    return part


def figures(engine: Engine, motion: Motion, cycles: int = 10) -> Figures:
    """Take the figures of the last cycles."""
    rows = cycle_rows(engine, motion, cycles)
    first, last = rows[0], rows[-1]
    seconds = float(last[at.REC_T] - first[at.REC_T])
    powers = (last - first)[at.REC_SUMS :] / seconds
    inner = rows[1:]
    tdc = float(np.mean(np.abs(inner[compressed(engine, inner), at.REC_X])))
    path = float(np.sum(np.abs(np.diff(rows[:, at.REC_X]))))
    indicated = _both(powers, at.W_GAS)
    spring, pressures = 0.0, 2
    if engine.calibration.cycle.fires == "left":
        pressures = 1
        indicated = float(powers[at.SUM + at.W_GAS])
        spring = float(powers[at.SUM + at.SUM_STRIDE + at.W_GAS])
    fuel = _both(powers, at.Q_FUEL)
    friction, motoring, pump = map(float, powers[[at.W_FRICTION, at.P_MOTOR, at.W_CASE]])
    c = engine.calibration
    return Figures(
        speed_rpm=60.0 * 0.5 * len(inner) / seconds,
        v_max_m_s=float(np.max(inner[:, at.REC_V_MAX])),
        v_mean_m_s=path / seconds,
        p_max_pa=float(np.max(inner[:, at.REC_P_LEFT : at.REC_P_LEFT + pressures])),
        compression_ratio=_compressed_from_m(engine, inner) / (c.left.length_m - tdc),
        tdc_m=tdc,
        indicated_w=indicated,
        electric_w=_electric(engine, powers, indicated + spring - friction - motoring + pump),
        motoring_w=motoring,
        friction_w=friction,
        heat_w=_both(powers, at.Q_WALL),
        exhaust_w=_both(powers, at.H_EX) - _both(powers, at.H_IN),
        leak_w=_both(powers, at.H_LEAK),
        pump_w=-pump,
        copper_w=float(powers[at.Q_COPPER]) * has_winding(engine),
        fuel_w=fuel,
        efficiency=indicated / fuel if fuel else 0.0,
        fuel_kg_kwh=(
            fuel / c.heat.heating_value_j_kg * _J_PER_KWH / indicated if indicated else 0.0
        ),
    )


def has_winding(engine: Engine) -> bool:
    """Whether the machine's own resistance is told: it delivers at its terminals."""
    return bool(engine.p[at.MACHINE] == at.DQ or engine.p[at.RESISTANCE] > 0.0)


def _electric(engine: Engine, powers: Array, on_the_mover_w: float) -> float:
    """Return the electric power; `on_the_mover_w` is that of eq. 4.1."""
    if has_winding(engine):
        return -float(powers[at.W_TERMINAL])
    if engine.calibration.cycle.kind == "speed":
        return float(powers[at.W_GENERATED] - powers[at.W_MOTORED])
    return on_the_mover_w


def compressed(engine: Engine, rows: Array) -> NDArray[np.bool_]:
    """Tell which dead centres end a compression of a charge."""
    cycle = engine.calibration.cycle
    if cycle.fires == "left":
        return np.equal(rows[:, at.REC_PHASE], 1.0)
    if cycle.kind != "four-stroke":
        return np.ones(len(rows), dtype=bool)
    return np.isin(rows[:, at.REC_PHASE], (1.0, 2.0))


def _compressed_from_m(engine: Engine, rows: Array) -> float:
    """Distance from the head at which compression begins: the last valve has closed.

    In a four-stroke engine that is the dead centre before, taken as the whole stroke where a head
    limits it, as the thesis does (section 3.3.3).
    """
    cycle, length = engine.calibration.cycle, engine.calibration.left.length_m
    if cycle.exhaust_closes_m is not None:
        return min(cycle.exhaust_closes_m, cycle.intake_closes_m or cycle.exhaust_closes_m)
    if cycle.fires == "left":
        return length + float(np.mean(rows[rows[:, at.REC_PHASE] == 0.0, at.REC_X]))
    return 2.0 * length


def _both(sums: Array, which: int) -> float:
    return float(sums[at.SUM + which] + sums[at.SUM + at.SUM_STRIDE + which])
