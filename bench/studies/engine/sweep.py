"""The thesis's parameter studies of its engines (Figs 4.15 to 4.20, 6.2; App. I Figs 10, 11)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from bench.studies.engine.operation import PART_LOADS, part_load, starting_peaks, varied
from bench.studies.engine.trace import Trace, cycle
from hil.config.detailed import Calibration, read
from hil.config.prototypes import NU
from hil.errors import ConfigError, HilError, RunError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine, Motion, engine_of
from plant.engines.detailed.figures import Figures, figures, settled
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_curve

_HALVINGS = 10
_FORCES = ("motor_1_n", "motor_2_n", "motor_3_n")

Settled = tuple[Engine, Motion]


class Sweep(NamedTuple):
    """What is varied, over which values, and how a value becomes a settled engine."""

    unit: str
    values: tuple[float, ...]
    run: Callable[[Calibration, float], Settled]


class SweepPoint(NamedTuple):
    """A value with its figures and a cycle of its motion, or with the reason why there are none."""

    value: float
    figures: Figures | None
    trace: Trace | None = None
    reason: str = ""


def _throttle(c: Calibration, value: float) -> Settled:
    """Fuel and intake opening by the throttle; the load goes down with it (thesis 4.3.1).

    The two-stroke engine's goes down as far as keeps its dead centre where it was, clear of misfire
    and head; the four-stroke's, whose motor forces stay, in proportion. The Beijing engine's load
    stays, and the throttle is closed in steps (App. I 4.2).
    """
    if c.name == "bit-running":
        return part_load(c, value)
    if c.cycle.kind == "two-stroke":
        return _held(c, value)
    return _loaded(c, value, value)


def _loaded(c: Calibration, throttle: float, load: float) -> Settled:
    """Settle at a throttle and a share of the nominal load."""
    scaled = {"load_coefficient_n_s_m": c.machine.load_coefficient_n_s_m * load}
    engine = engine_of(varied(c, machine=scaled), throttle=throttle)
    return engine, settled(engine)


def _held(c: Calibration, throttle: float) -> Settled:
    """Settle at a throttle with the load that leaves the dead centre where wide open has it.

    The bracket closes on the last load at which the engine reaches it; a stall lies beyond.
    """
    target_m = figures(*_loaded(c, 1.0, 1.0)).tdc_m
    low, high = throttle, 1.0
    found = _loaded(c, throttle, low)
    for _ in range(_HALVINGS if throttle < 1.0 else 0):
        middle = 0.5 * (low + high)
        try:
            tried = _loaded(c, throttle, middle)
            reached = figures(*tried).tdc_m >= target_m
        except RunError:
            reached = False
        if reached:
            low, found = middle, tried
        else:
            high = middle
    return found


def _ignition(c: Calibration, degrees: float) -> Settled:
    """Spark at dx = S/2 (1 - cos dtheta) before the nominal TDC (thesis eq. 4.3, corrected)."""
    advance_m = 2.0 * c.left.length_m * 0.5 * (1.0 - math.cos(math.radians(degrees)))
    nominal = engine_of(c)
    gap_m = c.left.length_m - figures(nominal, settled(nominal)).tdc_m
    cycle_ = c.cycle.model_copy(update={"ignition_from_head_m": gap_m + advance_m})
    engine = engine_of(c.model_copy(update={"cycle": cycle_}))
    return engine, settled(engine)


def _load(c: Calibration, scale: float) -> Settled:
    """Change the load of the settled engine, fuel and ignition position left alone."""
    machine = c.machine.model_copy(
        update={"load_coefficient_n_s_m": c.machine.load_coefficient_n_s_m * scale}
    )
    motion = settled(engine_of(c))
    engine = engine_of(c.model_copy(update={"machine": machine}))
    motion.d[at.LOAD] = machine.load_coefficient_n_s_m
    return engine, settled(engine, motion=motion)


def _motor_force(c: Calibration, scale: float) -> Settled:
    """Motor 1 with motors 2 and 3 in proportion (thesis 4.3.3)."""
    forces = {key: getattr(c.cycle, key) * scale for key in _FORCES}
    engine = engine_of(c.model_copy(update={"cycle": c.cycle.model_copy(update=forces)}))
    return engine, settled(engine)


DEGREES = (18.0, 20.0, 22.0, 24.0)
"""Ignition advances of Fig. 4.17."""

SWEEPS = {
    "throttle": Sweep("of wide open", (0.5, 0.6, 0.7, 0.8, 0.9, 1.0), _throttle),
    "ignition": Sweep("degrees before TDC", (15.0, 16.0, *DEGREES), _ignition),
    "load": Sweep("of nominal", (0.90, 0.95, 0.97, 1.0, 1.01, 1.02, 1.03, 1.05), _load),
    "motor-force": Sweep("of nominal", (0.95, 0.97, 1.0, 1.03, 1.05, 1.10), _motor_force),
}
STARTING_FORCES_N = (70.0, 90.0, 110.0, 130.0)
FUEL_CHANGES = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)


def sweep(over: str, name: str) -> list[SweepPoint]:
    """Run a study; where the engine stops or strikes a head there is a reason for a figure.

    Raises: ConfigError when the study means nothing for that engine
    """
    c = read(name)
    if over == "motor-force" and (c.cycle.kind != "four-stroke" or c.cycle.fires == "left"):
        raise ConfigError(
            f"--over motor-force: engine {name}: accepted are nu-four-stroke, bit-starting"
        )
    if c.cycle.kind in {"motoring", "speed"}:
        raise ConfigError(f"--over {over}: engine {name} is motored; accepted: --over motor-force")
    values = PART_LOADS if (over, name) == ("throttle", "bit-running") else SWEEPS[over].values
    return [_point(over, c, value) for value in values]


def _point(over: str, c: Calibration, value: float) -> SweepPoint:
    try:
        engine, motion = SWEEPS[over].run(c, value)
        found = figures(engine, motion)
        if motion.d[at.CONTACTS] > 0:
            return SweepPoint(value, None, None, f"{c.name}: the piston strikes a head")
        return SweepPoint(value, found, cycle(engine, motion))
    except HilError as error:
        return SweepPoint(value, None, None, str(error))


def starting_study() -> dict[float, list[float]]:
    """Peak pressures [bar] by cycle for the motor forces [N] of App. I Fig. 10."""
    return {force: starting_peaks(force) for force in STARTING_FORCES_N}


def fuel_study(changes: tuple[float, ...] = FUEL_CHANGES) -> list[tuple[float, float, float]]:
    """Change of fuel, TDC [m] and speed [rpm] of the fast model, heads disregarded (Fig. 6.2).

    X = F0 / (c omega_n), n = 60 omega_n / 2 pi     (thesis eqs. 6.1 and 6.2)
    """
    fuels_kg = [NU.fixed_fuel_kg * (1.0 + change) for change in changes]
    curve = fuel_curve(constants_of(NU, "harmonic"), fuels_kg, NU.load_coefficient_n_s_m)
    return list(zip(changes, curve.tdc_m, curve.speed_rpm, strict=True))
