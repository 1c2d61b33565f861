"""Open loop: fixed fuel, whatever happens."""

from __future__ import annotations

from typing import ClassVar, final

from controller.motion.law import Demand, Law, View


@final
class OpenLoop(Law[None]):
    """It remembers nothing."""

    name: ClassVar[str] = "open-loop"

    def initial(self) -> None:
        """Nothing."""

    def step(self, state: None, view: View) -> tuple[None, Demand]:
        """The configured fuel, or that of the operating point."""
        fuel = self.config.open_loop.fuel_kg
        return state, Demand(view.point.fuel_kg if fuel is None else fuel)
