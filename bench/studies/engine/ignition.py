"""What the spark's place is worth on a fast engine: best torque, knock, and the dead centre."""

from __future__ import annotations

import math
from typing import NamedTuple

from bench.run import scenarios
from bench.run.offline import simulate
from bench.run.resolve import resolve
from controller.build import make_params
from controller.knowledge import steady
from controller.motion.prediction import steady_dead_centre
from hil.config.load import build, with_override
from hil.config.plant import PlantConfig
from hil.config.prototypes import PROTOTYPES
from hil.config.resolved import Resolved
from plant.engines.fast.ignition import Compression, best_lead, knock_limited_lead, peak, work
from plant.rig.ignition import ignition_of

LONGEST_S = 8.0e-3
LEADS_S = (0.5e-3, 1.5e-3, 2.5e-3, 4.0e-3, 5.0e-3)
_PLANNED_S = 1.5e-3


class OperatingPoint(NamedTuple):
    """Of one dead centre and load: fuel, and the two leads with the piston's place at them."""

    tdc_m: float
    load_n_s_m: float
    fuel_kg: float
    best_s: float
    best_m: float
    knock_s: float
    knock_m: float
    peak_pa: float


class Estimate(NamedTuple):
    """A dead centre by the stroke's map from fuel and spark, and the one that the engine has."""

    fuel_kg: float
    lead_s: float
    work: float
    estimated_m: float
    settled_m: float


def compression(prototype: str, tdc_m: float, load_n_s_m: float) -> tuple[Compression, float]:
    """Return the settled stroke of eq. 5.60 about its dead centre, and its fuel."""
    engine = PROTOTYPES[prototype]
    fuel_kg, _, stroke_s = steady(engine, tdc_m, load_n_s_m)
    burn_s = PlantConfig().ignition.burn_s
    return Compression(
        tdc_m, engine.half_stroke_m, engine.area_m2, math.pi / stroke_s, engine.gamma,
        engine.p0_pa, engine.t0_k, fuel_kg * engine.heating_value_j_kg, burn_s,
    ), fuel_kg  # fmt: skip


def operating_points(prototype: str) -> list[OperatingPoint]:
    """Best-torque and knock-limited ignition at three dead centres and three loads."""
    engine = PROTOTYPES[prototype]
    found = []
    for shift_m in (-2e-3, 0.0, 1e-3):
        for scale in (0.8, 1.0, 1.2):
            tdc_m, load = engine.tdc_ref_m + shift_m, scale * engine.load_coefficient_n_s_m
            c, fuel_kg = compression(prototype, tdc_m, load)
            best_s, knock_s = best_lead(c, LONGEST_S), knock_limited_lead(c, LONGEST_S)
            found.append(OperatingPoint(
                tdc_m, load, fuel_kg, best_s, c.position_m(best_s), knock_s,
                c.position_m(knock_s), peak(c, min(best_s, knock_s))[0],
            ))  # fmt: skip
    return found


def worth(prototype: str) -> list[tuple[float, float, float]]:
    """Return lead [s], work by that of the planned one, peak pressure [Pa], at the set point."""
    engine = PROTOTYPES[prototype]
    c, _ = compression(prototype, engine.tdc_ref_m, engine.load_coefficient_n_s_m)
    planned = work(c, _PLANNED_S)
    return [(lead, work(c, lead) / planned, peak(c, lead)[0]) for lead in LEADS_S]


def estimates(model: str, fuel_shares: tuple[float, ...] = (0.97, 1.0, 1.03)) -> list[Estimate]:
    """Estimate dead centres by fuel and ignition, and run the engine open-loop beside."""
    base = _scenario(model, {})
    nominal_kg = base.controller.preset.fuel_kg or 0.0
    return [
        _estimate(base, _scenario(model, {
            "controller.open_loop.fuel_kg": share * nominal_kg,
            "controller.preset.fuel_kg": nominal_kg,
            "plant.ignition.lead_s": base.plant.ignition.lead_s,
            "plant.ignition.factor": base.plant.ignition.factor,
            "controller.timing.spark_advance_s": lead,
        }))
        for share in fuel_shares for lead in (0.5e-3, 1.5e-3, 2.5e-3)
    ]  # fmt: skip


def _scenario(model: str, changes: dict[str, object]) -> Resolved:
    tree = {**scenarios.tree_of("steady"), "expect": {}}
    settings = {
        "plant.model": model, "plant.ignition.work": "map", "run.duration_s": 1.5,
        "loop.clock": "lockstep",
        **({"controller.name": "open-loop"} if changes else {}), **changes,
    }  # fmt: skip
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    return resolve(build(tree, "steady"))


def _estimate(base: Resolved, run: Resolved) -> Estimate:
    """One fuel and one spark."""
    control = run.controller
    lead_s, fuel_kg = control.timing.spark_advance_s, control.open_loop.fuel_kg or 0.0
    factor = ignition_of(run.plant.ignition, run.plant.believed()).work_of(lead_s * 1e9)
    params = make_params(base.controller, base.plant.believed(), base.loop.period_ns)
    assert params.stroke_map is not None, "every fast engine has one"
    load, tdc_m = params.supervisor.initial().load_n_s_m, base.controller.tdc_ref_m
    estimated_m = steady_dead_centre(params.stroke_map, fuel_kg, factor, load, tdc_m)
    return Estimate(fuel_kg, lead_s, factor, estimated_m, abs(simulate(run).dead_centres[-1].x_m))
