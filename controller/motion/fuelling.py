"""The fuel for the dead centre ahead: by the law in force, or open after a start."""

from __future__ import annotations

from typing import Any, Final, final

from controller.motion.law import NO_DEMAND, Demand, Trim, View
from controller.motion.laws import LAWS
from hil.config.controller import ControllerConfig
from hil.values import Value, replace

BEYOND_SHARE: Final = 0.2
"""Of each stroke's demand in the average that a restart begins with."""


@final
class Fuelling(Value):
    """The law in force with its state, and the fuel that it has been asking for.

    burnt_kg: fuel planned for the last dead centre at the left and at the right head
    beyond_kg: what the law has been asking for beyond the steady fuel, averaged over some strokes
    """

    __slots__ = ("law_name", "law", "demand", "burnt_kg", "beyond_kg")

    def __init__(
        self, law_name: str, law: Any, demand: Demand, burnt_kg: tuple[float, float],  # noqa: ANN401
        beyond_kg: float = 0.0,
    ) -> None:  # fmt: skip
        self.law_name = law_name
        self.law = law
        self.demand = demand
        self.burnt_kg = burnt_kg
        self.beyond_kg = beyond_kg

    def asked_open(self, view: View) -> Fuelling:
        """Ask for the steady fuel, and for what the strokes before a restart needed beyond it."""
        demand = Demand(view.point.fuel_kg + self.beyond_kg, view.point.v_mid_m_s)
        return self.demanding(demand)

    def asked(self, config: ControllerConfig, view: View) -> Fuelling:
        """Ask the law for its fuel."""
        law, demand = LAWS[self.law_name].step(config, self.law, view)
        excess_kg = demand.fuel_kg - view.point.fuel_kg - self.beyond_kg
        beyond_kg = self.beyond_kg + BEYOND_SHARE * excess_kg
        return Fuelling(self.law_name, law, demand, self.burnt_kg, beyond_kg)

    def watched(
        self, config: ControllerConfig, view: View, planned_kg: float
    ) -> tuple[Fuelling, Trim]:
        """Let the law watch a tick; returns also the correction that it asks for."""
        watch = LAWS[self.law_name].watch
        assert watch is not None, "asked for by who watches only"
        law, trim = watch(config, self.law, view, planned_kg)
        after = Fuelling(self.law_name, law, self.demand, self.burnt_kg, self.beyond_kg)
        return after, trim

    def demanding(self, demand: Demand) -> Fuelling:
        """The same with another demand."""
        return Fuelling(self.law_name, self.law, demand, self.burnt_kg, self.beyond_kg)

    def after_dead_centre(self, side: int, fuel_kg: float) -> Fuelling:
        """Enter the fuel that was planned for a dead centre; what comes after is not asked yet."""
        left, right = self.burnt_kg
        burnt_kg = (fuel_kg, right) if side == 0 else (left, fuel_kg)
        return Fuelling(self.law_name, self.law, NO_DEMAND, burnt_kg, self.beyond_kg)

    def restarted(self) -> Fuelling:
        """The same after a restart of the engine."""
        return replace(self, law=LAWS[self.law_name].restarted(self.law))

    def handed_over(self, config: ControllerConfig, name: str, view: View) -> Fuelling:
        """Another law goes on, so that the fuel does not jump."""
        return replace(self, law_name=name, law=LAWS[name].taken_over(config, view))
