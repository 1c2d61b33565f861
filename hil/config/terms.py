"""The terms of a side, from its configuration, and what their hashes may stand for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args

from hil.config.engine.models import OWN_MODELS
from hil.config.names import ClockName
from hil.config.prototypes import PROTOTYPES
from hil.config.resolved import Resolved
from hil.wire.terms import VERSION, Terms, frames_text


def terms_of(scenario: Resolved) -> Terms:
    """Return what this side holds to."""
    loop, plant = scenario.loop, scenario.plant
    own = plant.own.model_dump_json(include={"name", "figures", "models"})
    stated = (plant.believed().model_dump_json(), plant.engine.model_dump_json(), own)
    figures = "\n".join(stated) + plant.fmu.sha256 + plant.own.sha256
    return (
        VERSION, frames_text(), loop.rate_hz, loop.clock, scenario.link.zenoh.engine,
        plant.prototype, plant.model, scenario.begins, figures,
    )  # fmt: skip


def known_names() -> Iterable[str]:
    """Return the names that a term may have."""
    return (*PROTOTYPES, *get_args(ClockName), "settled", "at-rest", "fmu", *OWN_MODELS)
