"""Single loop: one PI from the TDC of stroke j to the fuel of stroke j + 2.

m_fuel = m_0 + PI(tdc_ref - tdc)     (thesis section 6.2.2, Fig 6.3 and the delay of Table 6.2)
"""

from __future__ import annotations

from typing import NamedTuple

from controller.laws.interface import Demand, Handover, Law, StrokeFacts
from controller.laws.pi import pi_step
from hil.config.controller import ControllerConfig


class SingleLoopState(NamedTuple):
    """Integral, zero at the operating point."""

    integral_kg: float = 0.0


def step(
    config: ControllerConfig, state: SingleLoopState, facts: StrokeFacts
) -> tuple[SingleLoopState, Demand]:
    """Fuel for the combustion at the end of this stroke, which begins stroke j + 2."""
    point = facts.point
    integral, fuel = pi_step(
        config.single_loop.tdc,
        state.integral_kg,
        point.gain_scale * (facts.tdc_ref_m - facts.tdc_m),
        facts.fuel_min_kg - point.fuel_kg, facts.fuel_max_kg - point.fuel_kg,
    )  # fmt: skip
    demand = Demand(point.fuel_kg + fuel.u, inner_p_kg=fuel.p, inner_i_kg=fuel.i)
    return SingleLoopState(integral), demand


def take_over(config: ControllerConfig, handover: Handover) -> SingleLoopState:
    """The integral with which the loop asks for the fuel that is there."""
    burnt = handover.burnt_kg
    return SingleLoopState(0.5 * (burnt[0] + burnt[1]) - handover.point.fuel_kg)


LAW = Law(
    "single-loop", SingleLoopState(), step, take_over=take_over, after_restart=lambda state: state
)
