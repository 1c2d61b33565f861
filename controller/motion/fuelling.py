"""The fuel for the dead centre ahead: by the law in force, or open after a start."""

from __future__ import annotations

from typing import Any, Final, final

from mypy_extensions import i64

from controller.motion.law import NO_DEMAND, Demand, Law, Trim, View
from hil.values import Value

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

    def asked(self, by: Law[Any], view: View) -> Fuelling:
        """Ask the law for its fuel."""
        law, demand = by.step(self.law, view)
        excess_kg = demand.fuel_kg - view.point.fuel_kg - self.beyond_kg
        beyond_kg = self.beyond_kg + BEYOND_SHARE * excess_kg
        return Fuelling(self.law_name, law, demand, self.burnt_kg, beyond_kg)

    def watched(self, by: Law[Any], view: View, planned_kg: float) -> tuple[Fuelling, Trim]:
        """Let the law watch a tick; returns also the correction that it asks for."""
        law, trim = by.watch(self.law, view, planned_kg)
        if law is self.law:
            return self, trim
        return Fuelling(self.law_name, law, self.demand, self.burnt_kg, self.beyond_kg), trim

    def demanding(self, demand: Demand) -> Fuelling:
        """The same with another demand."""
        return Fuelling(self.law_name, self.law, demand, self.burnt_kg, self.beyond_kg)

    def after_dead_centre(self, side: i64, fuel_kg: float) -> Fuelling:
        """Enter the fuel that was planned for a dead centre; what comes after is not asked yet."""
        left, right = self.burnt_kg
        burnt_kg = (fuel_kg, right) if side == 0 else (left, fuel_kg)
        return Fuelling(self.law_name, self.law, NO_DEMAND, burnt_kg, self.beyond_kg)

    def restarted(self, by: Law[Any]) -> Fuelling:
        """The same after a restart of the engine."""
        law = by.restarted(self.law)
        return Fuelling(self.law_name, law, self.demand, self.burnt_kg, self.beyond_kg)

    def handed_over(self, name: str, to: Law[Any], view: View) -> Fuelling:
        """Another law goes on, so that the fuel does not jump."""
        return Fuelling(name, to.taken_over(view), self.demand, self.burnt_kg, self.beyond_kg)
