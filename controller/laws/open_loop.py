"""Open loop: fixed fuel, whatever happens."""

from __future__ import annotations

from controller.laws.interface import Demand, Law, StrokeFacts
from hil.config.controller import ControllerConfig


def step(config: ControllerConfig, state: None, facts: StrokeFacts) -> tuple[None, Demand]:
    """The configured fuel, or that of the operating point."""
    fuel = config.open_loop.fuel_kg
    return state, Demand(facts.point.fuel_kg if fuel is None else fuel)


LAW = Law("open-loop", None, step)
