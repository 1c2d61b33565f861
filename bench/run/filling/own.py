"""What a run with an engine of the user's own is filled in with: the figures of one like it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hil.brought import settings_of
from hil.config.check import check
from hil.config.engine.models import MODELS
from hil.config.plant import PlantConfig
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from plant.engines.own.physics import source_of

Resolve = Callable[[Scenario], Resolved]


def is_own(scenario: Scenario) -> bool:
    """Tell whether the plant is an engine that its user has brought."""
    return scenario.plant.model not in MODELS


def fill(scenario: Scenario, resolve: Resolve) -> Resolved:
    """Return the scenario resolved as with the model that the engine is like, the engine put back.

    Raises: ConfigError when it cannot be the plant of this run
    """
    plant = scenario.plant
    kind, brought = source_of(plant)
    settings = settings_of(kind, plant.own.settings, "plant.own.settings", brought.path)
    like = plant.own.like
    if "like" not in plant.own.model_fields_set:
        like = getattr(kind, "like", like)
    own = plant.own.model_copy(update={
        "file": plant.own.file and str(brought.path.resolve()), "sha256": brought.sha256,
        "like": like, "settings": {} if settings is None else settings.model_dump(),
    })  # fmt: skip
    return as_like(scenario, plant, like, {"own": own.model_dump()}, resolve)


def as_like(
    scenario: Scenario, plant: PlantConfig, like: str, engine: dict[str, Any], resolve: Resolve
) -> Resolved:
    """Return the scenario resolved with a model of ours, in whose place `engine` is put then.

    Raises: ConfigError when that model cannot be the plant of this run
    """
    bare = PlantConfig()
    kept = plant.own.model_copy(update={"file": "", "sha256": "", "settings": {}})
    stand_in = plant.model_copy(update={"model": like, "fmu": bare.fmu, "own": kept})
    tree: dict[str, Any] = resolve(scenario.model_copy(update={"plant": stand_in})).model_dump()
    tree["plant"] |= {"model": plant.model, **engine}
    return check(Resolved, tree, scenario.name)
