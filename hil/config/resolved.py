"""A scenario that leaves nothing open: what every loop, log, replay and report is given.

It is a scenario with the same keys; what the models and engines decide has a value in it, and its
type says so. `bench.run.resolve.resolve` makes one of a scenario.
"""

from __future__ import annotations

from pathlib import Path

from hil.config.controller import (
    ControllerConfig,
    FuelKg,
    LimitsConfig,
    MidSpeed,
    OpenLoopConfig,
    Preset,
)
from hil.config.load import read_as
from hil.config.plant import PlantConfig
from hil.config.ranges import CommandedLoad, LoadCoefficient
from hil.config.scenario import Scenario
from hil.config.supervisory.section import SupervisoryConfig
from hil.config.timing import Metres, StrokeTime
from hil.errors import ConfigError


class ResolvedPlant(PlantConfig):
    """The plant; its load coefficient is the engine's unless given."""

    load_coefficient_n_s_m: LoadCoefficient


class ResolvedOpenLoop(OpenLoopConfig):
    """The fuel is the model's own unless given."""

    fuel_kg: FuelKg


class ResolvedSupervisory(SupervisoryConfig):
    """The load coefficient is the engine's unless given."""

    load_coefficient_n_s_m: CommandedLoad


class ResolvedLimits(LimitsConfig):
    """The limit of position is the engine's unless given."""

    tdc_m: Metres


class ResolvedPreset(Preset):
    """The settled motion; an engine that burns nothing has no slope of fuel over speed."""

    fuel_kg: FuelKg
    v_mid_m_s: MidSpeed
    stroke_s: StrokeTime


class ResolvedController(ControllerConfig):
    """The controller, with set point, limit, load and operating point."""

    tdc_ref_m: Metres
    open_loop: ResolvedOpenLoop
    supervisory: ResolvedSupervisory
    limits: ResolvedLimits
    preset: ResolvedPreset


class Resolved(Scenario):
    """The whole configuration of a run, with nothing left open."""

    plant: ResolvedPlant
    controller: ResolvedController


def read_resolved(path: Path) -> Resolved:
    """Read what a run has left behind, or another scenario in which nothing is open.

    Raises: ConfigError naming file, key and what is accepted
    """
    try:
        return read_as(Resolved, path)
    except ConfigError as error:
        raise ConfigError(
            f"{error}; accepted: the scenario.json of a run (`hil plant` and `hil controller` fill"
            " in what a scenario leaves open)"
        ) from None
