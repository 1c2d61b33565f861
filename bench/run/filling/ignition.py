"""The map of the work by the spark's lead, where a fast model is to feel it."""

from __future__ import annotations

import math
from typing import Any

from hil.config.engine.models import FAST_MODELS
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from plant.engines.fast import ignition
from plant.engines.fast.ignition import Compression

_STEP_S, _LONGEST_S = 0.1e-3, 8.0e-3
_LEAST_S = 0.3e-3
"""A spark planned nearer to the dead centre may come behind it."""


def fill(scenario: Scenario, tree: dict[str, Any]) -> None:
    """Make the map of a run's settled stroke for plant and controller, each unless it is given.

    Parameters: tree : the scenario with all else filled in
    Raises: ConfigError where there is no such map, and for a spark that is to trim without one
    """
    plant, timing = tree["plant"]["ignition"], tree["controller"]["timing"]
    if plant["work"] == "constant":
        if timing["spark_trim"] and not timing["spark_lead_s"]:
            raise ConfigError(
                f"{scenario.name}: controller.timing.spark_trim: the work of a charge does not"
                " depend on its spark; accepted with plant.ignition.work = 'map'"
            )
        return
    if scenario.plant.model not in FAST_MODELS:
        raise ConfigError(
            f"{scenario.name}: plant.ignition.work = 'map': model {scenario.plant.model} burns by"
            f" its spark in any case; accepted there: constant"
        )
    if not plant["lead_s"]:
        plant |= made(compression_of(scenario, tree), timing["spark_advance_s"])
    if not timing["spark_lead_s"]:
        pairs = zip(plant["lead_s"], plant["factor"], strict=True)
        leads, factors = zip(*(pair for pair in pairs if pair[0] >= _LEAST_S), strict=True)
        timing |= {"spark_lead_s": leads, "spark_factor": factors}


def compression_of(scenario: Scenario, tree: dict[str, Any]) -> Compression:
    """Return the settled stroke about its dead centre."""
    engine, preset = scenario.plant.resolved_prototype(), tree["controller"]["preset"]
    return Compression(
        tree["controller"]["tdc_ref_m"], engine.half_stroke_m, engine.area_m2,
        math.pi / preset["stroke_s"], engine.gamma, engine.p0_pa, engine.t0_k,
        preset["fuel_kg"] * engine.heating_value_j_kg, tree["plant"]["ignition"]["burn_s"],
    )  # fmt: skip


def made(c: Compression, planned_s: float) -> dict[str, tuple[float, ...]]:
    """Return leads and factors; the planned lead is one of the points, with exactly 1."""
    grid = [n * _STEP_S for n in range(round(_LONGEST_S / _STEP_S) + 1)]
    apart = [lead for lead in grid if abs(lead - planned_s) > 0.5 * _STEP_S]
    leads = tuple(sorted((*apart, planned_s)))
    return {"lead_s": leads, "factor": ignition.factors(c, planned_s, leads)}
