"""Machine: fuel once a stroke, and the linear machine's own braking inside the stroke.

The generator's load coefficient is a command that acts from the next tick, so the braking force
c v can be modulated within a stroke: in every tick the c that ends this stroke at its set point,
z(dead centre; c) = X_ref, within limits about the load that the supervisory layer wants. The fuel
is set as if that load held throughout, so that the machine's part dies out as the fuel takes over.
"""

from __future__ import annotations

from typing import NamedTuple

from controller.laws import charge, load_estimate
from controller.laws.charge import Charge
from controller.laws.engine_map import travel
from controller.laws.interface import (
    Demand,
    Handover,
    Law,
    StrokeFacts,
    TickFacts,
    Trim,
)
from controller.laws.load_estimate import LoadEstimate
from controller.laws.pdf import fuel_after
from hil.config.controller import ControllerConfig, MachineLawConfig

_STEP = 0.03


class MachineState(NamedTuple):
    """Load, charge, the two last orders [N s/m], and the work of this stroke for learning.

    braked, swept: sums of c v^2 and of v^2 since the dead centre at start_m
    scale_then, begun_ns: scale of the load and instant of that dead centre
    end_m: dead centre predicted at mid-stroke for the braking of that moment, 0 before
    """

    load: LoadEstimate = LoadEstimate()
    charge: Charge = Charge()
    ordered_n_s_m: float = 0.0
    before_n_s_m: float = 0.0
    start_m: float = 0.0
    braked: float = 0.0
    swept: float = 0.0
    scale_then: float = 0.0
    fuel_for_n_s_m: float = 0.0
    end_m: float = 0.0
    begun_ns: int = -1


def step(
    config: ControllerConfig, state: MachineState, facts: StrokeFacts
) -> tuple[MachineState, Demand]:
    """The steady fuel for the load, until the watch trims it in the same tick."""
    fuel = charge.first_fuel(state.charge, facts)
    return state._replace(fuel_for_n_s_m=0.0), Demand(fuel, facts.point.v_mid_m_s)


def watch(
    config: ControllerConfig, state: MachineState, facts: TickFacts
) -> tuple[MachineState, Trim]:
    """Measure the load, order the braking, trim the fuel; learn at the dead centre."""
    base, motion = facts.load_n_s_m, facts.motion
    acting = state.before_n_s_m or base
    load = state.load
    if facts.power_w == facts.power_w:
        load = load_estimate.update(config.load_estimate, load, facts.power_w, motion.v_m_s, acting)
    if facts.passed.dead_centre:
        return _turn(config, state._replace(load=load), facts), Trim(load_n_s_m=base)
    v_sq = motion.v_m_s * motion.v_m_s
    state = state._replace(
        load=load, braked=state.braked + acting * load.scale * v_sq, swept=state.swept + v_sq
    )
    order, end = _braking(config.machine, state, facts)
    state = state._replace(ordered_n_s_m=order, before_n_s_m=state.ordered_n_s_m or base)
    c = base * load.scale
    settled = facts.planned_kg == 0.0 or not state.charge.known
    if settled or abs(c - state.fuel_for_n_s_m) <= config.load_estimate.retrim * c:
        return state, Trim(load_n_s_m=order)
    fuel = fuel_after(facts, state.charge, c, end)
    return state._replace(fuel_for_n_s_m=c), Trim(fuel, order)


def _braking(
    config: MachineLawConfig, state: MachineState, facts: TickFacts
) -> tuple[float, float]:
    """The load to order, and where the stroke ends with it; free before the limits bind."""
    motion, scale = facts.motion, max(state.load.scale, 0.05)
    free = facts.load_n_s_m * scale
    side = motion.side
    q = charge.effective(state.charge, side, facts.burnt_kg[side])
    z, v = motion.direction * motion.x_m, motion.direction * motion.v_m_s
    if q <= 0.0 or not state.start_m:
        return facts.load_n_s_m, facts.tdc_ref_m
    c0 = min(max(state.ordered_n_s_m * scale, 0.2 * free), 5.0 * free)
    model = state.charge.model or facts.model
    end0, left_s = travel(model, q, c0, z, v, facts.tau_s)
    # What was wrong from mid-stroke on last time is wrong in proportion to the way that is left.
    end0 += state.charge.ahead_m * min(2.0 * left_s / facts.model.stroke_s, 1.0)
    if left_s < config.release_s or facts.tau_s < config.begin_s:
        return facts.load_n_s_m, end0
    end1, _ = travel(model, q, c0 * (1.0 + _STEP), z, v, facts.tau_s)
    end1 += state.charge.ahead_m * min(2.0 * left_s / facts.model.stroke_s, 1.0)
    slope = (end1 - end0) / (c0 * _STEP)
    if slope >= -1e-12:
        return facts.load_n_s_m, end0
    wanted = c0 + config.gain * (facts.tdc_ref_m - end0) / slope
    c = min(max(wanted, config.least * facts.load_n_s_m), config.most * facts.load_n_s_m)
    return min(c / scale, config.most * facts.load_n_s_m), end0 + slope * (c - c0)


def _turn(config: ControllerConfig, state: MachineState, facts: TickFacts) -> MachineState:
    """At the dead centre: learn from the braking that this stroke has needed, begin the next."""
    motion, model, learnt = facts.motion, facts.model, state.charge
    fired = 1 - motion.side
    c = facts.load_n_s_m * state.load.scale
    if not learnt.known and state.load.variance <= load_estimate.UNSURE:
        learnt = charge.align(
            config.learning, learnt, model, c, facts.tdc_ref_m, motion.tdc_m, facts.burnt_kg
        )
    elif learnt.known and state.start_m > 0.0 and state.swept > 0.0 and facts.burnt_kg[fired] > 0.0:
        q = charge.effective(learnt, fired, facts.burnt_kg[fired])
        forecast = charge.foresee(
            learnt.model or model, q, state.braked / state.swept, state.start_m, state.begun_ns
        )
        steady = abs(state.load.scale - state.scale_then) <= (
            config.learning.load_change * state.load.scale
        )
        if steady:
            learnt = charge.learn(
                config.learning, learnt, fired, facts.burnt_kg[fired], forecast, motion.tdc_m,
                forecast.load_n_s_m, motion.dc_t_ns, model,
            )  # fmt: skip
    return MachineState(
        state.load, learnt, facts.load_n_s_m, state.ordered_n_s_m or facts.load_n_s_m,
        motion.tdc_m, 0.0, 0.0, state.load.scale, 0.0, 0.0, motion.dc_t_ns,
    )  # fmt: skip


def take_over(config: ControllerConfig, handover: Handover) -> MachineState:
    """Know nothing of the load yet, and align the shares with the fuel in force."""
    return MachineState(LoadEstimate(variance=1.0), Charge(known=False))


def after_restart(state: MachineState) -> MachineState:
    """Keep what was learnt; the stroke under way teaches nothing."""
    return state._replace(start_m=0.0, ordered_n_s_m=0.0, before_n_s_m=0.0, fuel_for_n_s_m=0.0)


LAW = Law(
    "machine", MachineState(), step, watch, take_over, after_restart, needs_model=True,
    needs_fit=True,
)  # fmt: skip
