"""The controller's step: the layers in their order, once a sample.

estimate -> start/restart -> supervisory -> piston motion -> timing -> actuator -> safety
(thesis Fig 6.1). Pure: the same parameters, state and inputs give the same output, bit for bit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controller import actuator, estimate, safety, supervisory, timing
from controller.actuator import Machine
from controller.commands import OperatorCommand
from controller.estimate import Motion, Passed
from controller.knowledge import motoring_force
from controller.laws import LAWS
from controller.laws.interface import NO_DEMAND, Demand, Law, StrokeFacts
from controller.start_restart import Facts, Mode, next_mode
from controller.supervisory import SetPoints
from controller.timing import NO_PLAN, Plan, PlannedPulse
from hil.config.controller import ControllerConfig
from hil.messages import Message, PistonSample
from hil.prototypes import PROTOTYPES, Prototype

MISFIRE_CHECK_FRACTION = 0.25
"""Part of a stroke after which the piston's speed tells whether the charge has burnt."""

MISFIRE_SPEED_RATIO = 0.6
"""Below this share of the expected speed it has not: the air springs alone give 0.2 to 0.45."""

FIRING_MODES = (Mode.MOTORING, Mode.GENERATING)
"""In any other mode the TTL lines are low; the plant's decoder knows the same two."""

REST_SPEED_M_S = 2e-3
REST_POSITION_M = 2e-3


class Params(NamedTuple):
    """What does not change during a run."""

    config: ControllerConfig
    engine: Prototype
    law: Law
    period_ns: int
    limit_m: float
    full_load_n_s_m: float
    motoring_limit_ns: int


class State(NamedTuple):
    """Everything that the controller remembers from tick to tick."""

    mode: Mode
    motion: Motion
    set_points: SetPoints
    law: Any
    demand: Demand
    plan: Plan
    pulses: tuple[PlannedPulse, ...]
    stale: int
    misfires: int
    fired_t_ns: int
    fired_strokes: int
    since_t_ns: int


class Inputs(NamedTuple):
    """What comes in with a tick; `sample` is None when none that is valid came."""

    tick: int
    sample: PistonSample | None
    command: OperatorCommand | None = None


class StrokeReport(NamedTuple):
    """One finished stroke, for the log."""

    number: int
    side: int
    tdc_m: float
    tdc_ref_m: float
    v_mid_m_s: float
    demand: Demand


class Output(NamedTuple):
    """What goes out: the answer's messages, what they say in SI, and what the log should know."""

    messages: tuple[Message, ...]
    machine: Machine
    throttle: float
    pulses: tuple[PlannedPulse, ...]
    stroke: StrokeReport | None
    events: tuple[tuple[str, str], ...]
    may_fire: bool


def make_params(config: ControllerConfig, prototype: str, period_ns: int) -> Params:
    """Resolve a configuration for a prototype and a tick."""
    engine = PROTOTYPES[prototype]
    limit = engine.position_limit_m if config.limits.tdc_m is None else config.limits.tdc_m
    full = supervisory.full_load(config, engine)
    motoring_limit_ns = round(config.start.timeout_s * 1e9)
    return Params(config, engine, LAWS[config.name], period_ns, limit, full, motoring_limit_ns)


def initial_state(params: Params) -> State:
    """The state before the first tick: running in the steady state, or off."""
    set_points = supervisory.initial(params.config, params.engine)
    mode = Mode.GENERATING if params.config.running else Mode.OFF
    motion = Motion(tdc_m=set_points.tdc_ref_m)
    return State(
        mode, motion, set_points, params.law.initial, NO_DEMAND, NO_PLAN, (),
        0, 0, -1, params.config.start.open_strokes, 0,
    )  # fmt: skip


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """Answer one tick.

    Returns: the next state and the output, which acts at the plant's next tick
    """
    t_ns = inputs.tick * params.period_ns
    motion, passed, stale = _observe(state, inputs.sample, t_ns)
    mode, state, events = _decide_mode(params, state, inputs, motion, passed, stale, t_ns)
    set_points = supervisory.slew(
        params.config, params.engine, state.set_points, params.period_ns * 1e-9
    )
    law, demand, plan = state.law, state.demand, state.plan
    stroke = None
    if passed.dead_centre:
        stroke = StrokeReport(
            motion.stroke, motion.side, motion.tdc_m, set_points.tdc_ref_m, motion.v_mid_m_s, demand
        )
        plan, demand = NO_PLAN, NO_DEMAND
    if passed.mid_stroke and _may_fire(params, mode, motion, set_points):
        law, demand = _demand(params, state, motion, set_points)
        plan = timing.plan_injection(
            params.config, motion, t_ns, params.period_ns, set_points.point.stroke_s, demand.fuel_kg
        )
    if plan.fuel_kg > 0.0:
        plan = timing.plan_spark(
            params.config, plan, motion, t_ns, params.period_ns, set_points.point.stroke_s
        )
    pulses = actuator.still_open(state.pulses, (plan.injection, plan.spark), t_ns)
    machine = safety.limit_machine(params.config.limits, _machine(params, mode, motion, set_points))
    after = State(
        mode, motion, set_points, law, demand, plan, pulses, stale,
        state.misfires, state.fired_t_ns, state.fired_strokes, state.since_t_ns,
    )  # fmt: skip
    messages = actuator.messages(inputs.tick, mode, machine, set_points.throttle, pulses)
    may_fire = mode in FIRING_MODES
    return after, Output(messages, machine, set_points.throttle, pulses, stroke, events, may_fire)


def _observe(state: State, sample: PistonSample | None, t_ns: int) -> tuple[Motion, Passed, int]:
    """Take the sample into the estimate, or count that there was none."""
    if sample is None:
        return state.motion, estimate.NOTHING, state.stale + 1
    motion, passed = estimate.update(state.motion, t_ns, sample.x_m, sample.v_m_s)
    return motion, passed, 0


def _decide_mode(
    params: Params,
    state: State,
    inputs: Inputs,
    motion: Motion,
    passed: Passed,
    stale: int,
    t_ns: int,
) -> tuple[Mode, State, tuple[tuple[str, str], ...]]:
    """Level 1: judge the combustion, take the operator's command, apply the mode table."""
    events: tuple[tuple[str, str], ...] = ()
    command = inputs.command
    if command is not None:
        state, events = _obey(params, state, command)
    fired = passed.dead_centre and state.plan.fuel_kg > 0.0
    misfired = False
    if fired:
        state = state._replace(fired_t_ns=motion.dc_t_ns, fired_strokes=state.fired_strokes + 1)
    elif state.fired_t_ns >= 0 and stale == 0 and _check_is_due(state, t_ns):
        misfired = _has_misfired(state, motion)
        misfires = state.misfires + 1 if misfired else 0
        state = state._replace(fired_t_ns=-1, misfires=misfires)
    config = params.config
    facts = Facts(
        command is not None and command.kind == "start",
        command is not None and command.kind == "stop",
        stale >= config.limits.stale_ticks,
        safety.is_beyond(params.limit_m, motion.tdc_m if passed.dead_centre else motion.x_m),
        fired,
        misfired,
        state.misfires >= config.limits.misfires,
        t_ns - state.since_t_ns > params.motoring_limit_ns,
        abs(motion.v_m_s) < REST_SPEED_M_S and abs(motion.x_m) < REST_POSITION_M,
    )
    mode, rule = next_mode(state.mode, facts)
    if rule:
        events = (
            *events,
            (f"mode {mode.name.lower()}", f"{state.mode.name} -> {mode.name}: {rule}"),
        )
        state = _enter(params, state, mode, t_ns)
    return mode, state, events


def _obey(
    params: Params, state: State, command: OperatorCommand
) -> tuple[State, tuple[tuple[str, str], ...]]:
    """Take an operator's command; start and stop are facts for the mode table."""
    tdc_m = command.tdc_ref_m
    if tdc_m is not None and safety.is_beyond(params.limit_m, tdc_m):
        text = f"tdc_ref_m={tdc_m:g} from {command.origin}: accepted up to {params.limit_m:g}"
        return state, (("command-refused", text),)
    if command.kind == "set-point":
        set_points = supervisory.change(
            params.config,
            params.engine,
            state.set_points,
            command.tdc_ref_m,
            command.target_power_w,
        )
        state = state._replace(set_points=set_points)
    given = command._asdict() | {"kind": None, "origin": None}
    numbers = [f"{name}={value:g}" for name, value in given.items() if value is not None]
    return state, (("command", " ".join([command.kind, *numbers, f"from {command.origin}"])),)


def _enter(params: Params, state: State, mode: Mode, t_ns: int) -> State:
    """What a change of mode resets: outside generating nothing may fire that was planned before."""
    state = state._replace(mode=mode, since_t_ns=t_ns)
    if mode is Mode.GENERATING:
        return state._replace(law=params.law.initial, fired_strokes=1)
    if mode is Mode.MOTORING:
        return state._replace(plan=NO_PLAN, demand=NO_DEMAND, pulses=())
    return state._replace(plan=NO_PLAN, demand=NO_DEMAND, pulses=(), fired_t_ns=-1, misfires=0)


def _check_is_due(state: State, t_ns: int) -> bool:
    """Whether enough of the stroke has passed to tell combustion from misfire."""
    stroke_ns = state.set_points.point.stroke_s * 1e9
    return t_ns - state.fired_t_ns >= MISFIRE_CHECK_FRACTION * stroke_ns


def _has_misfired(state: State, motion: Motion) -> bool:
    """Compare the speed reached since the dead centre with that of a burnt charge.

    v = v_mid sin(pi t / T), scaled by the dead centre from which the piston started.
    """
    point = state.set_points.point
    scale = motion.tdc_m / state.set_points.tdc_ref_m
    expected = point.v_mid_m_s * scale * math.sqrt(0.5)  # sin(pi / 4)
    return motion.direction * motion.v_m_s < MISFIRE_SPEED_RATIO * expected


def _may_fire(params: Params, mode: Mode, motion: Motion, set_points: SetPoints) -> bool:
    """Fire while generating, and while motoring once the amplitude allows ignition."""
    if mode is Mode.GENERATING:
        return True
    ignition_m = params.config.start.ignition_ratio * set_points.tdc_ref_m
    return mode is Mode.MOTORING and motion.tdc_m >= ignition_m


def _demand(
    params: Params, state: State, motion: Motion, set_points: SetPoints
) -> tuple[Any, Demand]:
    """Level 3: the fuel for the dead centre ahead; after a start first the steady fuel."""
    config, point, law = params.config, set_points.point, state.law
    if state.mode is Mode.MOTORING or state.fired_strokes < config.start.open_strokes:
        demand = Demand(point.fuel_kg, point.v_mid_m_s)
    else:
        most = config.limits.fuel_max_kg * set_points.throttle
        facts = StrokeFacts(
            set_points.tdc_ref_m, motion.tdc_m, motion.v_mid_m_s, point,
            config.limits.fuel_min_kg, most,
        )  # fmt: skip
        law, demand = params.law.step(config, law, facts)
    return law, safety.limit_fuel(config.limits, set_points.throttle, demand)


def _machine(params: Params, mode: Mode, motion: Motion, set_points: SetPoints) -> Machine:
    """The machine's order in this mode; motoring pushes in the direction of motion."""
    force = 0.0
    if mode is Mode.MOTORING:
        start = params.config.start
        direction = motion.direction or 1
        amplitude = start.amplitude_ratio * set_points.tdc_ref_m
        force = direction * min(start.force_n, motoring_force(
            params.engine, motion.x_m, motion.v_m_s, direction, amplitude))  # fmt: skip
    return actuator.machine_for(mode, force, set_points.load_n_s_m, params.full_load_n_s_m)
