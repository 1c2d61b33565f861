"""What a run with a Functional Mock-up Unit is filled in with: the figures of a model like it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.run.filling.own import Resolve, as_like
from hil.config.plant import PlantConfig
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from plant.engines.fmu.archive import Archive, open_archive
from plant.engines.fmu.unit import Unit


def is_unit(scenario: Scenario) -> bool:
    """Tell whether the plant is a Functional Mock-up Unit."""
    return scenario.plant.model == "fmu"


def fill(scenario: Scenario, resolve: Resolve) -> Resolved:
    """Return the scenario resolved as with the model that the unit is like, the unit put back.

    Raises: ConfigError when the unit cannot be the plant of this run
    """
    archive = open_archive(Path(scenario.plant.fmu.file), scenario.plant.fmu.sha256)
    plant = _with_origin(scenario, archive)
    unit = Unit(archive, plant.fmu.names, plant.fmu.parameters)
    if scenario.begins == "settled" and not unit.begins_settled:
        raise ConfigError(
            f"{scenario.name}: {archive.path} cannot begin settled: it has no parameters start_x_m "
            "and start_fuel_kg; accepted: --set begins=at-rest"
        )
    fmu = plant.fmu.model_copy(
        update={"file": str(archive.path.resolve()), "sha256": archive.sha256}
    )
    return as_like(scenario, plant, fmu.like, {"fmu": fmu.model_dump()}, resolve)


def _with_origin(scenario: Scenario, archive: Archive) -> PlantConfig:
    """A unit of our own export says which model and prototype it is, unless they are given."""
    plant = scenario.plant
    if archive.own is None:
        return plant
    model, prototype = archive.own
    changes: dict[str, Any] = {}
    if "like" not in plant.fmu.model_fields_set:
        changes["fmu"] = plant.fmu.model_copy(update={"like": model})
    if "prototype" not in plant.model_fields_set:
        changes["prototype"] = prototype
    return plant.model_copy(update=changes)
