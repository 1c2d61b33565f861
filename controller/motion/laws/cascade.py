"""Cascade: outer PI on the last TDC, inner PI on this stroke's mid-stroke velocity.

v_ref = v_0 + PI_outer(tdc_ref - tdc),  m_fuel = m_0 + PI_inner(v_ref - v_mid)
(thesis section 6.2.2, Figs 6.4 and 6.5)
"""

from __future__ import annotations

from typing import ClassVar, final

from controller.motion.law import Demand, Law, View
from controller.motion.pi import pi_step
from hil.values import Value


@final
class CascadeState(Value):
    """Integrals of both loops, zero at the operating point."""

    __slots__ = ("outer_m_s", "inner_kg")

    def __init__(self, outer_m_s: float = 0.0, inner_kg: float = 0.0) -> None:
        self.outer_m_s = outer_m_s
        self.inner_kg = inner_kg


@final
class Cascade(Law[CascadeState]):
    """Both loops, called once a stroke."""

    name: ClassVar[str] = "cascade"
    parameters: ClassVar[tuple[str, ...]] = (
        "cascade.outer.kp", "cascade.outer.ki", "cascade.inner.kp", "cascade.inner.ki",
    )  # fmt: skip

    def initial(self) -> CascadeState:
        """The operating point."""
        return CascadeState()

    def step(self, state: CascadeState, view: View) -> tuple[CascadeState, Demand]:
        """Fuel for the combustion at the end of this stroke."""
        point, motion, gains = view.point, view.motion, self.config.cascade
        v_max = gains.v_correction_max_m_s
        outer, v = pi_step(
            gains.outer, state.outer_m_s, view.tdc_ref_m - motion.tdc_m, -v_max, v_max
        )
        v_ref = point.v_mid_m_s + v.u
        inner, fuel = pi_step(
            gains.inner, state.inner_kg, point.gain_scale * (v_ref - motion.v_mid_m_s),
            view.fuel_min_kg - point.fuel_kg, view.fuel_max_kg - point.fuel_kg,
        )  # fmt: skip
        demand = Demand(point.fuel_kg + fuel.u, v_ref, v.p, v.i, fuel.p, fuel.i)
        return CascadeState(outer, inner), demand

    def taken_over(self, view: View) -> CascadeState:
        """The integrals with which the loops ask for the speed and the fuel that are there."""
        v_max = self.config.cascade.v_correction_max_m_s
        outer = min(max(view.motion.v_mid_m_s - view.point.v_mid_m_s, -v_max), v_max)
        left, right = view.burnt_kg
        return CascadeState(outer, 0.5 * (left + right) - view.point.fuel_kg)

    def restarted(self, state: CascadeState) -> CascadeState:
        """All of it is kept."""
        return state
