"""Engines behind one protocol (protocol.py): each folder is one kind of physics."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from hil.config.engine.models import DETAILED_MODELS, FAST_MODELS
from hil.config.plant import PlantConfig
from plant.engines.protocol import Engine

_FOLDERS: Final[dict[str, str]] = {
    **dict.fromkeys(FAST_MODELS, "fast"),
    **dict.fromkeys(DETAILED_MODELS, "detailed"),
    "fmu": "fmu",
}


def build_engine(config: PlantConfig, period_ns: int) -> Engine:
    """Build the engine that a configuration names; only the one that is named needs its library.

    Raises: ConfigError when it cannot be built so, MissingExtraError
    """
    module = import_module(f"plant.engines.{_FOLDERS.get(config.model, 'own')}.model")
    engine: Engine = module.build(config, period_ns)
    return engine
