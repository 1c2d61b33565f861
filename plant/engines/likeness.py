"""The settled motion of a model of ours, for an engine that begins a run as that one does."""

from __future__ import annotations

from importlib import import_module

from hil.config.engine.models import DETAILED_MODELS
from hil.config.plant import PlantConfig
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import limit_cycle


def settled_tdc_m(config: PlantConfig, like: str, fuel_kg: float, load_n_s_m: float) -> float:
    """Dead centre of the settled motion of the model that an engine is like [m].

    Raises: ConfigError when there is no such motion
    """
    if like in DETAILED_MODELS:
        module = import_module("plant.engines.detailed.settle")
        calibration = module.calibration_of(config.model_copy(update={"model": like}))
        return -float(module.settle(calibration, fuel_kg, load_n_s_m).y[0])
    constants = constants_of(config.resolved_prototype(), like)
    return limit_cycle(constants, fuel_kg, load_n_s_m).tdc_m
