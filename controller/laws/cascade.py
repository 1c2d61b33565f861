"""Cascade: outer PI on the last TDC, inner PI on this stroke's mid-stroke velocity.

v_ref = v_0 + PI_outer(tdc_ref - tdc),  m_fuel = m_0 + PI_inner(v_ref - v_mid)
(thesis section 6.2.2, Figs 6.4 and 6.5)
"""

from __future__ import annotations

from typing import NamedTuple

from controller.laws.interface import Demand, Handover, Law, StrokeFacts
from controller.laws.pi import pi_step
from hil.config.controller import ControllerConfig


class CascadeState(NamedTuple):
    """Integrals of both loops, zero at the operating point."""

    outer_m_s: float = 0.0
    inner_kg: float = 0.0


def step(
    config: ControllerConfig, state: CascadeState, facts: StrokeFacts
) -> tuple[CascadeState, Demand]:
    """Fuel for the combustion at the end of this stroke."""
    point, gains = facts.point, config.cascade
    v_max = gains.v_correction_max_m_s
    outer, v = pi_step(gains.outer, state.outer_m_s, facts.tdc_ref_m - facts.tdc_m, -v_max, v_max)
    v_ref = point.v_mid_m_s + v.u
    inner, fuel = pi_step(
        gains.inner, state.inner_kg, point.gain_scale * (v_ref - facts.v_mid_m_s),
        facts.fuel_min_kg - point.fuel_kg, facts.fuel_max_kg - point.fuel_kg,
    )  # fmt: skip
    demand = Demand(point.fuel_kg + fuel.u, v_ref, v.p, v.i, fuel.p, fuel.i)
    return CascadeState(outer, inner), demand


def take_over(config: ControllerConfig, handover: Handover) -> CascadeState:
    """The integrals with which the loops ask for the speed and the fuel that are there."""
    point, burnt = handover.point, handover.burnt_kg
    v_max = config.cascade.v_correction_max_m_s
    outer = min(max(handover.v_mid_m_s - point.v_mid_m_s, -v_max), v_max)
    return CascadeState(outer, 0.5 * (burnt[0] + burnt[1]) - point.fuel_kg)


LAW = Law("cascade", CascadeState(), step, take_over=take_over, after_restart=lambda state: state)
