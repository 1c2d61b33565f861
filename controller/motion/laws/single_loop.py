"""Single loop: one PID from the TDC of stroke j to the fuel of stroke j + 2.

m_fuel = m_0 + PID(tdc_ref - tdc)     (thesis section 6.2.2, Fig 6.3, eqs. 6.3 and 6.4, and the
delay of Table 6.2)

TDC is compared with the set point under which its stroke was ordered (`ordered`), and the fuel is
shared between cylinders that differ (`balance`).
"""

from __future__ import annotations

from typing import ClassVar, Final, final

from controller.motion import balance
from controller.motion.balance import EVEN, Balance
from controller.motion.law import Demand, Law, View
from controller.motion.ordered import Ordered
from controller.motion.pid import Loop, pid_step
from controller.motion.quiet import NOTHING_SEEN, Noise, Quiet
from hil.config.controller import ControllerConfig
from hil.values import Value

_AT_REST: Final = Loop()
_NEVER: Final = Ordered()


@final
class SingleLoopState(Value):
    """The loop, at rest at the operating point; orders under way; balance of the cylinders."""

    __slots__ = ("loop", "ordered", "balance", "noise")

    def __init__(
        self,
        loop: Loop = _AT_REST,
        ordered: Ordered = _NEVER,
        balance: Balance = EVEN,
        noise: Noise = NOTHING_SEEN,
    ) -> None:
        self.loop = loop
        self.ordered = ordered
        self.balance = balance
        self.noise = noise


@final
class SingleLoop(Law[SingleLoopState]):
    """One loop, called once a stroke."""

    name: ClassVar[str] = "single-loop"
    parameters: ClassVar[tuple[str, ...]] = (
        "single_loop.tdc.kp", "single_loop.tdc.ki", "single_loop.tdc.kd",
    )  # fmt: skip

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.quiet = Quiet(config.quiet)

    def initial(self) -> SingleLoopState:
        """The operating point."""
        return SingleLoopState()

    def step(self, state: SingleLoopState, view: View) -> tuple[SingleLoopState, Demand]:
        """Fuel for the combustion at the end of this stroke, which begins stroke j + 2."""
        point, motion = view.point, view.motion
        e_m = state.ordered.for_dead_centre(view.tdc_ref_m, view.lag) - motion.tdc_m
        noise = state.noise.after(self.quiet, e_m, motion.side)
        loop, fuel = pid_step(
            self.config.single_loop.tdc, state.loop, point.gain_scale * e_m,
            view.fuel_min_kg - point.fuel_kg, view.fuel_max_kg - point.fuel_kg,
            noise.share(self.quiet),
        )  # fmt: skip
        even = balance.learnt(self.config.learning, state.balance, view, e_m)
        fuel_kg = view.limited_kg(even.shared(point.fuel_kg + fuel.u, view.fuel_side))
        demand = Demand(fuel_kg, inner_p_kg=fuel.pd, inner_i_kg=fuel.i)
        return SingleLoopState(loop, state.ordered.and_now(view.tdc_ref_m), even, noise), demand

    def taken_over(self, view: View) -> SingleLoopState:
        """The integral with which the loop asks for the fuel that is there."""
        left, right = view.burnt_kg
        e_m = view.tdc_ref_m - view.motion.tdc_m
        loop = Loop(0.5 * (left + right) - view.point.fuel_kg, view.point.gain_scale * e_m)
        return SingleLoopState(loop, _NEVER, balance.of_burnt(self.config.learning, view))

    def restarted(self, state: SingleLoopState) -> SingleLoopState:
        """Loop and balance are kept; no order is under way."""
        return SingleLoopState(state.loop, _NEVER, state.balance.forgetting(), state.noise)
