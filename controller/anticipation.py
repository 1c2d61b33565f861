"""What holds while samples are missing: dead centres by the map, pulses ordered ahead."""

from __future__ import annotations

from mypy_extensions import i64

from controller import safety
from controller.mode.start_restart import GENERATING, Mode
from controller.motion.drive import counted
from controller.motion.fuelling import Fuelling
from controller.motion.law import Demand
from controller.motion.prediction import dead_centre, seconds_ahead, unseen_dead_centre
from controller.observe.estimate import Motion, Observation
from controller.orders import inject
from controller.state import Params, State
from controller.supervisory import SetPoints
from controller.timing.advance import continued, plan_ahead, postponed
from controller.timing.injection import retime_injection
from controller.timing.plan import NO_PLAN, Plan
from hil.rounding import nearest


def turned(params: Params, state: State, seen: Observation) -> Observation:
    """Have the map tell the dead centre that no sample has shown, or none could well enough."""
    stroke_map = params.stroke_map
    if params.cycle is not None:
        seen = seen.with_motion(counted(state.motion, seen.motion))
    if seen.whole and (stroke_map is None or not stroke_map.hardens):
        return seen
    load, charges = braking(state.operation.mode, state.set_points, state.fuelling)
    if seen.whole and stroke_map is not None:
        motion = dead_centre(stroke_map, state.motion, seen.motion, load, charges)
    else:
        motion = unseen_dead_centre(stroke_map, state.motion, seen.motion, load, charges)
    return seen.with_motion(motion)


def braking(
    mode: Mode, set_points: SetPoints, fuelling: Fuelling
) -> tuple[float, tuple[float, float]]:
    """Load coefficient and charges with which a stroke goes on in this mode."""
    if mode is GENERATING:
        return set_points.load_n_s_m, fuelling.burnt_kg
    return 0.0, (0.0, 0.0)


def _steady(params: Params, set_points: SetPoints, fuelling: Fuelling) -> Demand:
    """The fuel that strokes have needed of late, for one of which the law cannot be asked."""
    demand = Demand(set_points.point.fuel_kg + fuelling.beyond_kg, set_points.point.v_mid_m_s)
    return safety.limit_fuel(params.limits, set_points.most_kg, demand)


def unasked(
    params: Params, state: State, seen: Observation, set_points: SetPoints, fuelling: Fuelling
) -> tuple[Fuelling, Plan]:
    """Plan a stroke whose middle no sample has shown: as ordered ahead, or on the steady fuel."""
    demand = _steady(params, set_points, fuelling)
    if state.ahead.fuel_kg > 0.0:
        return fuelling.demanding(demand.of(state.ahead.fuel_kg)), state.ahead
    motion, stroke_s = seen.motion, set_points.point.stroke_s
    plan = inject(params, state, motion, seen.t_ns, stroke_s, state.plan, demand.fuel_kg)
    ends_ns = end_of_stroke(params, motion, set_points, fuelling)
    if params.port is None and plan.injection is not None and plan.injection.close_ns > ends_ns:
        # What flows behind the dead centre is there for the next charge of that side.
        timings, period_ns = params.timings, params.period_ns
        plan = retime_injection(timings, plan, ends_ns, seen.t_ns, period_ns, demand.fuel_kg)
        demand = demand.of(plan.fuel_kg)
    return fuelling.demanding(demand), plan


def planned_by_law(
    params: Params, state: State, seen: Observation, set_points: SetPoints, fuelling: Fuelling,
    plan: Plan,
) -> Plan:  # fmt: skip
    """Plan the injection that the law has asked for at mid-stroke."""
    timings, stroke_s = params.timings, set_points.point.stroke_s
    fuel_kg = fuelling.demand.fuel_kg
    plan = inject(params, state, seen.motion, seen.t_ns, stroke_s, plan, fuel_kg)
    plan = continued(timings, state.ahead, plan, seen.t_ns + timings.act_ticks * params.period_ns)
    if seen.unheard:  # what is due soon would come too late
        plan = postponed(timings, plan, end_of_stroke(params, seen.motion, set_points, fuelling))
    return plan


def ordered_ahead(
    params: Params, state: State, seen: Observation, set_points: SetPoints, fuelling: Fuelling,
    plan: Plan, judged_t_ns: i64,
) -> Plan:  # fmt: skip
    """What is ordered for the dead centre ahead before the law is asked, once a charge has burnt.

    Parameters: judged_t_ns : dead centre whose combustion was still to be judged before this tick
    """
    operation, timings = state.operation, params.timings
    if seen.passed.dead_centre or plan.fuel_kg > 0.0 or operation.mode is not GENERATING:
        return NO_PLAN
    if judged_t_ns < 0 or operation.fired_t_ns >= 0:
        return state.ahead
    motion = seen.motion
    if timings.spark_position_m is not None or not timings.fire(motion.stroke):
        return NO_PLAN
    if params.port is not None:  # what burns next is in the cylinder already
        return NO_PLAN
    stroke_s = set_points.point.stroke_s
    fuel_kg = _steady(params, set_points, fuelling).fuel_kg
    ends_ns = end_of_stroke(params, motion, set_points, fuelling)
    return plan_ahead(timings, motion, ends_ns, params.period_ns, stroke_s, fuel_kg)


def end_of_stroke(params: Params, motion: Motion, set_points: SetPoints, fuelling: Fuelling) -> i64:
    """When the stroke under way will end: by the map, or as a steady one would [ns]."""
    stroke_map = params.stroke_map
    if stroke_map is None:
        return motion.dc_t_ns + nearest(set_points.point.stroke_s * 1e9)
    load_n_s_m = set_points.load_n_s_m
    ahead_s = seconds_ahead(stroke_map, motion, load_n_s_m, fuelling.burnt_kg)
    return motion.t_ns + nearest(ahead_s * 1e9)
