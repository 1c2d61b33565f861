"""Cascade: outer PID on the last TDC, inner PID on this stroke's mid-stroke velocity.

v_ref = v_0 + PID_outer(tdc_ref - tdc),  m_fuel = m_0 + PID_inner(v_ref - v_mid)
(thesis section 6.2.2, Figs 6.4 and 6.5, eqs. 6.3 and 6.4)

TDC and speed are compared with the set points under which their strokes were ordered (`ordered`),
and the fuel is shared between cylinders that differ (`balance`). At one set point, with equal
cylinders, it is the thesis's law.
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
class CascadeState(Value):
    """Both loops, at rest at the operating point; orders under way; balance of the cylinders."""

    __slots__ = ("outer", "inner", "ordered", "balance", "noise")

    def __init__(
        self, outer: Loop = _AT_REST, inner: Loop = _AT_REST, ordered: Ordered = _NEVER,
        balance: Balance = EVEN, noise: Noise = NOTHING_SEEN,
    ) -> None:  # fmt: skip
        self.outer = outer
        self.inner = inner
        self.ordered = ordered
        self.balance = balance
        self.noise = noise


@final
class Cascade(Law[CascadeState]):
    """Both loops, called once a stroke."""

    name: ClassVar[str] = "cascade"
    parameters: ClassVar[tuple[str, ...]] = (
        "cascade.outer.kp", "cascade.outer.ki", "cascade.inner.kp", "cascade.inner.ki",
    )  # fmt: skip

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.quiet = Quiet(config.quiet)

    def initial(self) -> CascadeState:
        """The operating point."""
        return CascadeState()

    def step(self, state: CascadeState, view: View) -> tuple[CascadeState, Demand]:
        """Fuel for the combustion at the end of this stroke."""
        point, motion, gains, ref_m = view.point, view.motion, self.config.cascade, view.tdc_ref_m
        v_max = gains.v_correction_max_m_s
        e_m = state.ordered.for_dead_centre(ref_m, view.lag) - motion.tdc_m
        v_0 = point.v_mid_m_s * (state.ordered.for_mid_stroke(ref_m, view.lag) / ref_m)
        next_m = (
            point.gain_scale
            * (v_0 + state.outer.integral - motion.v_mid_m_s)
            * ref_m
            / point.v_mid_m_s
        )
        noise = state.noise.after(self.quiet, e_m, motion.side, next_m)
        share = noise.share(self.quiet)
        outer, v = pid_step(gains.outer, state.outer, e_m, -v_max, v_max, share)
        v_ref = v_0 + v.u
        inner, fuel = pid_step(
            gains.inner, state.inner, point.gain_scale * (v_ref - motion.v_mid_m_s),
            view.fuel_min_kg - point.fuel_kg, view.fuel_max_kg - point.fuel_kg,
            share,
        )  # fmt: skip
        even = balance.learnt(self.config.learning, state.balance, view, e_m)
        fuel_kg = view.limited_kg(even.shared(point.fuel_kg + fuel.u, view.fuel_side))
        demand = Demand(fuel_kg, v_ref, v.pd, v.i, fuel.pd, fuel.i)
        return CascadeState(outer, inner, state.ordered.and_now(ref_m), even, noise), demand

    def taken_over(self, view: View) -> CascadeState:
        """The integrals with which the loops ask for the speed and the fuel that are there."""
        v_max, motion = self.config.cascade.v_correction_max_m_s, view.motion
        v = min(max(motion.v_mid_m_s - view.point.v_mid_m_s, -v_max), v_max)
        left, right = view.burnt_kg
        return CascadeState(
            Loop(v, view.tdc_ref_m - motion.tdc_m), Loop(0.5 * (left + right) - view.point.fuel_kg),
            _NEVER, balance.of_burnt(self.config.learning, view),
        )  # fmt: skip

    def restarted(self, state: CascadeState) -> CascadeState:
        """The loops and the balance are kept; no order is under way."""
        return CascadeState(
            state.outer, state.inner, _NEVER, state.balance.forgetting(), state.noise
        )
