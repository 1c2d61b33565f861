"""Single loop: one PI from the TDC of stroke j to the fuel of stroke j + 2.

m_fuel = m_0 + PI(tdc_ref - tdc)     (thesis section 6.2.2, Fig 6.3 and the delay of Table 6.2)
"""

from __future__ import annotations

from typing import ClassVar, final

from controller.motion.law import Demand, Law, View
from controller.motion.pi import pi_step
from hil.values import Value


@final
class SingleLoopState(Value):
    """Integral, zero at the operating point."""

    __slots__ = ("integral_kg",)

    def __init__(self, integral_kg: float = 0.0) -> None:
        self.integral_kg = integral_kg


@final
class SingleLoop(Law[SingleLoopState]):
    """One loop, called once a stroke."""

    name: ClassVar[str] = "single-loop"
    parameters: ClassVar[tuple[str, ...]] = ("single_loop.tdc.kp", "single_loop.tdc.ki")

    def initial(self) -> SingleLoopState:
        """The operating point."""
        return SingleLoopState()

    def step(self, state: SingleLoopState, view: View) -> tuple[SingleLoopState, Demand]:
        """Fuel for the combustion at the end of this stroke, which begins stroke j + 2."""
        point = view.point
        integral, fuel = pi_step(
            self.config.single_loop.tdc, state.integral_kg,
            point.gain_scale * (view.tdc_ref_m - view.motion.tdc_m),
            view.fuel_min_kg - point.fuel_kg, view.fuel_max_kg - point.fuel_kg,
        )  # fmt: skip
        demand = Demand(point.fuel_kg + fuel.u, inner_p_kg=fuel.p, inner_i_kg=fuel.i)
        return SingleLoopState(integral), demand

    def taken_over(self, view: View) -> SingleLoopState:
        """The integral with which the loop asks for the fuel that is there."""
        left, right = view.burnt_kg
        return SingleLoopState(0.5 * (left + right) - view.point.fuel_kg)

    def restarted(self, state: SingleLoopState) -> SingleLoopState:
        """All of it is kept."""
        return state
