"""The controller's step: the layers in their order, once a sample.

estimate -> start/restart -> supervisory -> piston motion -> timing -> actuator -> safety
(thesis Fig 6.1). Pure: the same parameters, state and inputs give the same output, bit for bit.
"""

from __future__ import annotations

from typing import Any

from controller import (
    actuator,
    estimate,
    ignition,
    operation,
    safety,
    supervisory,
    timing,
    trimming,
)
from controller.actuator import Machine
from controller.estimate import Motion, Passed
from controller.knowledge import motoring_force
from controller.laws import LAWS
from controller.laws.interface import NO_DEMAND, Demand, StrokeFacts
from controller.start_restart import Mode
from controller.state import Inputs, Output, Params, State, StrokeReport
from controller.supervisory import SetPoints
from controller.timing import NO_PLAN, Plan
from hil.wire.messages import PistonSample
from hil.wire.pulses import may_fire

SHORTEST_STROKE = 0.3
"""Dead centres nearer to each other than this part of a steady stroke are one and the same."""

NO_CHARGES = (0.0, 0.0)

BEYOND_SHARE = 0.2
"""Of each stroke's demand in the average that a restart begins with."""


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """Answer one tick.

    Returns: the next state and the output, which acts at the plant's next tick
    """
    t_ns = inputs.tick * params.period_ns
    motion, passed, stale = _observe(state, inputs.sample, t_ns)
    mode, state, events = operation.decide(params, state, inputs, motion, passed, stale, t_ns)
    set_points = supervisory.slew(
        params.config, params.engine, state.set_points, params.period_ns * 1e-9
    )
    law, demand, plan, burnt_kg = state.law, state.demand, state.plan, state.burnt_kg
    beyond_kg = state.beyond_kg
    stroke = None
    if passed.dead_centre:
        if _fires(params, motion.stroke - 1):
            stroke = StrokeReport(
                motion.stroke, motion.side, motion.tdc_m, set_points.tdc_ref_m, motion.v_mid_m_s,
                demand,
            )  # fmt: skip
        burnt_kg = _burnt(state, motion)
        plan, demand = NO_PLAN, NO_DEMAND
    due = passed.mid_stroke and _fires(params, motion.stroke)
    if due and _may_fire(params, mode, motion, set_points):
        law, demand, beyond_kg = _demand(params, state, motion, set_points)
        plan = timing.plan_injection(
            params.config, motion, t_ns, params.period_ns, set_points.point.stroke_s, demand.fuel_kg
        )
    machine = _machine(params, mode, motion, set_points)
    watch = LAWS[state.law_name].watch
    if watch is not None and _may_watch(params, mode, state, stale):
        assert params.model is not None, "checked when the law was chosen"
        law, demand, plan, machine = trimming.trim(
            params.config, params.model, watch, law, demand, plan, machine, motion=motion,
            passed=passed, set_points=set_points, burnt_kg=burnt_kg, power_w=inputs.power_w,
            t_ns=t_ns, period_ns=params.period_ns,
        )  # fmt: skip
    if plan.fuel_kg > 0.0:
        plan = _with_spark(params, mode, motion, set_points, plan, burnt_kg, t_ns)
    pulses = actuator.still_open(state.pulses, (plan.injection, plan.spark), t_ns)
    machine = safety.limit_machine(params.config.limits, machine)
    after = State(
        mode, motion, set_points, law, demand, plan, pulses, stale,
        state.misfires, state.fired_t_ns, state.fired_strokes, state.since_t_ns, state.law_name,
        burnt_kg, beyond_kg,
    )  # fmt: skip
    messages = actuator.messages(inputs.tick, mode, machine, set_points.throttle, pulses)
    fires = may_fire(mode)
    return after, Output(messages, machine, set_points.throttle, pulses, stroke, events, fires)


def _with_spark(
    params: Params, mode: Mode, motion: Motion, set_points: SetPoints, plan: Plan,
    burnt_kg: tuple[float, float], t_ns: int,
) -> Plan:  # fmt: skip
    """Level 4: the spark, by the best prediction that there is of this stroke."""
    timings, period_ns = params.config.timing, params.period_ns
    braked, charges = set_points.load_n_s_m, burnt_kg
    if mode is not Mode.GENERATING:
        braked, charges = 0.0, NO_CHARGES
    if timings.spark_position_m is None:
        ahead = trimming.ahead_by(params.model, motion, braked, charges, period_ns)
    else:
        ahead = ignition.ahead_of(
            params.engine, motion, period_ns * 1e-9, braked, timings.spark_position_m,
            timings.spark_advance_s,
        )  # fmt: skip
    return timing.plan_spark(
        params.config, plan, motion, t_ns, period_ns, set_points.point.stroke_s, ahead
    )


def _observe(state: State, sample: PistonSample | None, t_ns: int) -> tuple[Motion, Passed, int]:
    """Take the sample into the estimate, or count that there was none."""
    if sample is None:
        return state.motion, estimate.NOTHING, state.stale + 1
    motion, passed = estimate.update(state.motion, t_ns, sample.x_m, sample.v_m_s)
    return motion, passed, 0


def _burnt(state: State, motion: Motion) -> tuple[float, float]:
    """Enter what was planned for a dead centre.

    At the dead centre at which a run begins noise may show one more, for which nothing is planned.
    """
    burnt_kg, fuel_kg = state.burnt_kg, state.plan.fuel_kg
    apart_ns = motion.dc_t_ns - state.motion.dc_t_ns
    if fuel_kg == 0.0 and apart_ns < SHORTEST_STROKE * state.set_points.point.stroke_s * 1e9:
        return burnt_kg
    return (fuel_kg, burnt_kg[1]) if motion.side == 0 else (burnt_kg[0], fuel_kg)


def _may_watch(params: Params, mode: Mode, state: State, stale: int) -> bool:
    """A law watches the ticks in which it would also be asked for fuel, and a sample came."""
    generating = mode is Mode.GENERATING and state.mode is mode
    return generating and not stale and state.fired_strokes >= params.config.start.open_strokes


def _fires(params: Params, stroke: int) -> bool:
    """Whether that stroke ends in a combustion; a four-stroke engine's gas exchange has no TDC."""
    fires = params.config.timing.fires
    return fires[stroke % len(fires)]


def _may_fire(params: Params, mode: Mode, motion: Motion, set_points: SetPoints) -> bool:
    """Fire while generating, and while motoring once the amplitude allows ignition."""
    if mode is Mode.GENERATING:
        return True
    ignition_m = params.config.start.ignition_ratio * set_points.tdc_ref_m
    return mode is Mode.MOTORING and motion.tdc_m >= ignition_m


def _demand(
    params: Params, state: State, motion: Motion, set_points: SetPoints
) -> tuple[Any, Demand, float]:
    """Level 3: the fuel for the dead centre ahead; after a restart that of the strokes before it.

    Returns: the law's state, its demand, and `State.beyond_kg`
    """
    config, point, law = params.config, set_points.point, state.law
    beyond_kg = state.beyond_kg
    if state.mode is Mode.MOTORING or state.fired_strokes < config.start.open_strokes:
        demand = Demand(point.fuel_kg + beyond_kg, point.v_mid_m_s)
    else:
        most = config.limits.fuel_max_kg * set_points.throttle
        facts = StrokeFacts(
            set_points.tdc_ref_m, motion.tdc_m, motion.v_mid_m_s, point,
            config.limits.fuel_min_kg, most, set_points.load_n_s_m,
            1 if motion.direction > 0 else 0, state.burnt_kg, params.model,
        )  # fmt: skip
        law, demand = LAWS[state.law_name].step(config, law, facts)
        beyond_kg += BEYOND_SHARE * (demand.fuel_kg - point.fuel_kg - beyond_kg)
    return law, safety.limit_fuel(config.limits, set_points.throttle, demand), beyond_kg


def _machine(params: Params, mode: Mode, motion: Motion, set_points: SetPoints) -> Machine:
    """The machine's order in this mode; motoring pushes in the direction of motion."""
    force = 0.0
    if mode is Mode.MOTORING:
        start = params.config.start
        direction = motion.direction or 1
        amplitude = start.amplitude_ratio * set_points.tdc_ref_m
        force = direction * start.force_n
        if not start.constant_force:
            force = direction * min(start.force_n, motoring_force(
                params.engine, motion.x_m, motion.v_m_s, direction, amplitude))  # fmt: skip
    return actuator.machine_for(mode, force, set_points.load_n_s_m, params.full_load_n_s_m)
