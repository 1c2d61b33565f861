"""The controller's step: the layers in their order, once a sample.

estimate -> start/restart -> supervisory -> piston motion -> timing -> actuator -> safety
(thesis Fig 6.1). Pure: the same parameters, state and inputs give the same output, bit for bit.
"""

from __future__ import annotations

import math
from typing import Any, Final

from mypy_extensions import i64

from controller import actuator, safety
from controller.anticipation import braking, ordered_ahead, planned_by_law, turned, unasked
from controller.mode.combustion import has_misfired
from controller.mode.operation import decide, is_uneventful
from controller.mode.start_restart import GENERATING, MOTORING, Mode
from controller.motion.fuelling import Fuelling
from controller.motion.law import NO_DEMAND, Law, View
from controller.motion.prediction import seconds_to_spark, wanted_work
from controller.observe import power
from controller.observe.estimate import (
    Motion,
    Observation,
    observe,
    seconds_to_dead_centre,
)
from controller.orders import filmed, machine_order, obey, reinject, with_valves
from controller.protecting import derated, protected
from controller.state import Inputs, Output, Params, State, report_of, view_of
from controller.supervision.protection import Protection
from controller.supervisory import SHORT_M, Events, SetPoints
from controller.timing import position
from controller.timing.advance import is_far
from controller.timing.plan import NO_PLAN, Plan, PlannedPulse
from controller.timing.spark import may_move, plan_spark
from hil.rounding import nearest
from hil.values import replace
from hil.wire.commands import OperatorCommand

SHORTEST_STROKE: Final = 0.3
"""Dead centres nearer to each other than this part of a steady stroke are one and the same."""


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """Answer one tick.

    Returns: the next state and the output, which acts at the plant's next tick
    """
    t_ns = inputs.tick * params.period_ns
    fault = inputs.fault or state.protection.trip
    seen = observe(state.motion, state.stale, inputs.sample, t_ns, fault)
    if seen.passed.dead_centre:
        seen = turned(params, state, seen)
    judged, before, verdict = state.operation.fired_t_ns, state.motion, state.operation.verdict
    state, events = _operate(params, state, seen, inputs.command)
    protection, cycle, told = protected(params, state, seen, inputs, verdict)
    if told:
        events = (*events, *told)
    set_points = derated(params, state.set_points, protection)
    set_points = params.supervisor.slew(set_points, params.dt_s)
    metering, stroke = state.metering, None
    if seen.passed.dead_centre:
        metering = power.ended(metering, seen.motion.dc_t_ns)
        stroke = report_of(params, state, seen.motion, set_points, metering.mean_w)
        if seen.whole:
            set_points, told = _regulated(params, state, seen.motion, set_points, metering.mean_w)
            events = (*events, *told) if told else events
        set_points = params.supervisor.approach(set_points)
    metering = power.read(metering, t_ns, inputs.power_w)
    fuelling, plan, load_n_s_m = _fuel(params, state, seen, set_points, inputs.power_w)
    mode = state.operation.mode
    if plan.fuel_kg > 0.0 and (plan.later_kg < 0.0 or seen.motion.passed_mid):
        plan = _with_spark(
            params, mode, seen.motion, set_points, plan, fuelling, t_ns, state.pulses, protection
        )
    ahead = ordered_ahead(params, state, seen, set_points, fuelling, plan, judged)
    first = plan if plan.is_set else ahead
    film = filmed(params, state, seen.motion) if seen.passed.dead_centre else state.film
    pulses = actuator.still_open(state.pulses, first.injection, first.spark, t_ns)
    driving, machine = machine_order(params, state.drive, mode, seen, set_points, load_n_s_m)
    machine = safety.limit_machine(params.limits, machine)
    moved, sent = with_valves(params, state.valves, before, seen, inputs, mode, pulses)
    after = State(
        seen.motion, seen.stale, state.operation, set_points, fuelling, plan, pulses, ahead, moved,
        metering, driving, film, protection,
    )  # fmt: skip
    return after, Output(mode, machine, set_points.throttle, sent, stroke, events, cycle)


def _operate(
    params: Params, state: State, seen: Observation, command: OperatorCommand | None
) -> tuple[State, Events]:
    """Level 1: the operator's command and the mode, and what a change of it resets."""
    stroke_s = state.set_points.point.stroke_s
    if command is None and is_uneventful(params.bounds, state.operation, seen, stroke_s):
        return state, ()
    events: Events = ()
    if command is not None:
        state, events = obey(params, state, command)
    set_points, burnt_kg, before = state.set_points, state.fuelling.burnt_kg, state.operation
    operation, rule = decide(
        params.bounds, before, seen, "" if command is None else command.kind,
        fuel_kg=state.in_force.fuel_kg, stroke_s=set_points.point.stroke_s,
        has_misfired=lambda: has_misfired(params.stroke_map, seen.motion, set_points, burnt_kg),
    )  # fmt: skip
    if operation is before:
        return state, events
    if not rule:
        return replace(state, operation=operation), events
    text = f"{before.mode.name} -> {operation.mode.name}: {rule}"
    events = (*events, (f"mode {operation.mode.name.lower()}", text))
    return _entered(params, replace(state, operation=operation)), events


def _entered(params: Params, state: State) -> State:
    """What a change of mode resets: outside generating nothing may fire that was planned before."""
    fuelling = state.fuelling
    if state.mode is GENERATING:
        return replace(state, fuelling=fuelling.restarted(params.law_of(fuelling.law_name)))
    beyond_kg = fuelling.beyond_kg if state.mode is MOTORING else 0.0
    fuelling = replace(fuelling, demand=NO_DEMAND, beyond_kg=beyond_kg)
    return replace(state, fuelling=fuelling, plan=NO_PLAN, pulses=(), ahead=NO_PLAN)


def _regulated(
    params: Params, state: State, motion: Motion, set_points: SetPoints, power_w: float | None
) -> tuple[SetPoints, Events]:
    """Level 2: the load by the power of the stroke that has ended, once the law is in charge."""
    if not _is_steered(params, state):
        return set_points, ()
    is_low = set_points.tdc_ref_m - motion.tdc_m > SHORT_M
    is_short = is_low and state.fuelling.demand.fuel_kg >= set_points.most_kg
    return params.supervisor.regulated(set_points, power_w, is_short)


def _fuel(
    params: Params, state: State, seen: Observation, set_points: SetPoints, power_w: float
) -> tuple[Fuelling, Plan, float]:
    """Level 3: the fuel for the dead centre ahead, and the load that the law wants by then.

    Returns: the law with its demand, the injection planned for it, load coefficient [N s/m]
    """
    fuelling, plan = state.fuelling, state.plan
    if seen.passed.dead_centre:
        fuelling, plan = _burnt(state, seen.motion), state.plan.successor
    due = seen.passed.mid_stroke and _is_to_fire(params, state, seen.motion, set_points)
    if due and not seen.whole:
        fuelling, plan = unasked(params, state, seen, set_points, fuelling)
        due = False
    law = params.law_of(fuelling.law_name)
    watches = law.watches and _may_watch(params, state, seen)
    if not (due or watches):
        return fuelling, plan, set_points.load_n_s_m
    view = view_of(params, seen.motion, seen.passed, set_points, fuelling, power_w, plan.fuel_kg)
    if due:
        fuelling = _asked(params, state, fuelling, view, set_points.most_kg)
        plan = planned_by_law(params, state, seen, set_points, fuelling, plan)
    if not watches:
        return fuelling, plan, set_points.load_n_s_m
    return _trimmed(params, law, fuelling, plan, view, set_points.most_kg, state)


def _burnt(state: State, motion: Motion) -> Fuelling:
    """Enter what was planned for a dead centre.

    At the dead centre at which a run begins noise may show one more, for which nothing is planned.
    """
    fuel_kg = state.in_force.fuel_kg * state.in_force.work
    apart_ns = motion.dc_t_ns - state.motion.dc_t_ns
    if fuel_kg == 0.0 and float(apart_ns) < SHORTEST_STROKE * state.set_points.point.stroke_s * 1e9:
        return state.fuelling.demanding(NO_DEMAND)
    return state.fuelling.after_dead_centre(motion.side, fuel_kg)


def _may_watch(params: Params, state: State, seen: Observation) -> bool:
    """A law watches the ticks in which it would also be asked for fuel, and a sample came."""
    return seen.stale == 0 and _is_steered(params, state)


def _is_steered(params: Params, state: State) -> bool:
    """Whether the law steers the engine: generating, and the open strokes of a start are over."""
    operation = state.operation
    return operation.mode is GENERATING and operation.fired_strokes >= params.start.open_strokes


def _is_to_fire(params: Params, state: State, motion: Motion, set_points: SetPoints) -> bool:
    """Fire while generating, and while motoring once the amplitude allows ignition."""
    if not params.timings.fire(motion.stroke):
        return False
    mode = state.operation.mode
    if mode is GENERATING:
        return True
    ignition_m = params.start.ignition_ratio * set_points.tdc_ref_m
    return mode is MOTORING and motion.tdc_m >= ignition_m


def _asked(
    params: Params, state: State, fuelling: Fuelling, view: View, most_kg: float
) -> Fuelling:
    """The fuel for the dead centre ahead; after a restart that of the strokes before it."""
    operation = state.operation
    if operation.mode is MOTORING or operation.fired_strokes < params.start.open_strokes:
        fuelling = fuelling.asked_open(view)
    else:
        fuelling = fuelling.asked(params.law_of(fuelling.law_name), view)
    return fuelling.demanding(safety.limit_fuel(params.limits, most_kg, fuelling.demand))


def _trimmed(
    params: Params, law: Law[Any], fuelling: Fuelling, plan: Plan, view: View, most_kg: float,
    state: State,
) -> tuple[Fuelling, Plan, float]:  # fmt: skip
    """Let the law watch the tick, and retime the injection that is still to be trimmed."""
    motion = view.motion
    fuelling, trim = fuelling.watched(law, view, plan.asked_kg)
    if trim.fuel_kg is not None and plan.asked_kg > 0.0:
        wanted = fuelling.demand.of(trim.fuel_kg)
        fuelling = fuelling.demanding(safety.limit_fuel(params.limits, most_kg, wanted))
    stroke_map = view.stroke_map
    if stroke_map is None:  # the law trims nothing: what does needs a map
        return fuelling, plan, view.load_n_s_m if trim.load_n_s_m is None else trim.load_n_s_m
    if plan.injection is not None and plan.injection.close_ns > motion.t_ns:
        timings, load = params.timings, law.load_of(fuelling.law, view.load_n_s_m)
        ahead_s = seconds_to_spark(
            stroke_map, motion, load, view.burnt_kg, timings.spark_position_m,
            timings.spark_advance_s,
        )  # fmt: skip
        plan = reinject(
            params, state, fuelling, motion, motion.t_ns + nearest(ahead_s * 1e9), plan,
            fuelling.demand.fuel_kg,
        )  # fmt: skip
    return fuelling, plan, view.load_n_s_m if trim.load_n_s_m is None else trim.load_n_s_m


def _with_spark(
    params: Params, mode: Mode, motion: Motion, set_points: SetPoints, plan: Plan,
    fuelling: Fuelling, t_ns: i64, pulses: tuple[PlannedPulse, ...], protection: Protection,
) -> Plan:  # fmt: skip
    """Level 4: the spark, by the best prediction that there is of this stroke."""
    timings, period_ns, stroke_map = params.timings, params.period_ns, params.stroke_map
    if not may_move(timings, plan, t_ns, period_ns):
        return plan
    braked, charges = braking(mode, set_points, fuelling)
    place_m, advance_s = timings.spark_position_m, timings.spark_advance_s
    if place_m is not None:
        place_m += params.guard.retard_m(protection)
    if mode is GENERATING:
        braked = params.law_of(fuelling.law_name).load_of(fuelling.law, braked)
    lead_s, work = advance_s, 1.0
    if place_m is not None and (stroke_map is None or not stroke_map.tells_force):
        seconds = position.seconds_to_spark(
            params.engine, motion, params.dt_s, braked, place_m, advance_s
        )
    elif stroke_map is not None:
        seconds = seconds_to_spark(stroke_map, motion, braked, charges, place_m, advance_s)
        if timings.spark_trim:
            wanted = wanted_work(
                stroke_map, motion, braked, charges, set_points.tdc_ref_m, plan.fuel_kg
            )
            lead_s, work = timings.lead_for(wanted)
    else:
        seconds = seconds_to_dead_centre(motion, params.dt_s, math.pi / set_points.point.stroke_s)
        if is_far(timings, plan, pulses, motion.side_ahead, seconds):
            return plan
    return plan_spark(timings, plan, motion, t_ns, period_ns, seconds, lead_s, work)
