"""Open loop: fixed fuel, whatever happens."""

from __future__ import annotations

from controller.motion.law import Demand, Law, View
from hil.config.controller import ControllerConfig


def step(config: ControllerConfig, state: None, view: View) -> tuple[None, Demand]:
    """The configured fuel, or that of the operating point."""
    fuel = config.open_loop.fuel_kg
    return state, Demand(view.point.fuel_kg if fuel is None else fuel)


LAW = Law("open-loop", None, step)
