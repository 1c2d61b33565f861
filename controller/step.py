"""The controller's step: the layers in their order, once a sample.

estimate -> start/restart -> supervisory -> piston motion -> timing -> actuator -> safety
(thesis Fig 6.1). Pure: the same parameters, state and inputs give the same output, bit for bit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controller import actuator, estimate, ignition, safety, supervisory, timing, trimming
from controller.actuator import Machine
from controller.commands import OperatorCommand
from controller.estimate import Motion, Passed
from controller.knowledge import motoring_force
from controller.laws import LAWS
from controller.laws.engine_map import EngineMap
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

SHORTEST_STROKE = 0.3
"""Dead centres nearer to each other than this part of a steady stroke are one and the same."""

NO_CHARGES = (0.0, 0.0)

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
    model: EngineMap | None


class State(NamedTuple):
    """Everything that the controller remembers from tick to tick.

    law_name: the law in force, whose state is `law`
    burnt_kg: fuel planned for the last dead centre at the left and at the right head
    """

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
    law_name: str
    burnt_kg: tuple[float, float]


class Inputs(NamedTuple):
    """What comes in with a tick; `sample` is None when none that is valid came.

    power_w: electric power, nan when this tick's frames carried none
    """

    tick: int
    sample: PistonSample | None
    command: OperatorCommand | None = None
    power_w: float = math.nan


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
    """Resolve a configuration for a prototype and a tick.

    Raises: ConfigError when the law cannot work with it
    """
    engine = PROTOTYPES[prototype]
    limit = engine.position_limit_m if config.limits.tdc_m is None else config.limits.tdc_m
    full = supervisory.full_load(config, engine)
    motoring_limit_ns = round(config.start.timeout_s * 1e9)
    model = trimming.model_of(config, engine)
    trimming.check(config, model)
    law = LAWS[config.name]
    return Params(config, engine, law, period_ns, limit, full, motoring_limit_ns, model)


def initial_state(params: Params) -> State:
    """The state before the first tick: running in the steady state, or off."""
    set_points = supervisory.initial(params.config, params.engine)
    mode = Mode.GENERATING if params.config.running else Mode.OFF
    motion = Motion(tdc_m=set_points.tdc_ref_m)
    return State(
        mode, motion, set_points, params.law.initial, NO_DEMAND, NO_PLAN, (),
        0, 0, -1, params.config.start.open_strokes, 0, params.law.name,
        (set_points.point.fuel_kg, set_points.point.fuel_kg),
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
    law, demand, plan, burnt_kg = state.law, state.demand, state.plan, state.burnt_kg
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
        law, demand = _demand(params, state, motion, set_points)
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
        burnt_kg,
    )  # fmt: skip
    messages = actuator.messages(inputs.tick, mode, machine, set_points.throttle, pulses)
    may_fire = mode in FIRING_MODES
    return after, Output(messages, machine, set_points.throttle, pulses, stroke, events, may_fire)


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
        misfired = _has_misfired(params, state, motion)
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
    if command.law is not None:
        reason = trimming.refusal(command.law, params.model)
        if reason:
            return state, (("command-refused", f"{reason} (from {command.origin})"),)
        state = _change_law(params, state, command.law)
    return state, (("command", command.describe()),)


def _change_law(params: Params, state: State, name: str) -> State:
    """Let another law go on from here; in a mode without one it will begin afresh."""
    law = trimming.hand_over(params.config, name, state.motion, state.set_points, state.burnt_kg)
    return state._replace(law_name=name, law=law)


def _enter(params: Params, state: State, mode: Mode, t_ns: int) -> State:
    """What a change of mode resets: outside generating nothing may fire that was planned before."""
    state = state._replace(mode=mode, since_t_ns=t_ns)
    if mode is Mode.GENERATING:
        law = LAWS[state.law_name].restarted(state.law)
        return state._replace(law=law, fired_strokes=1)
    if mode is Mode.MOTORING:
        return state._replace(plan=NO_PLAN, demand=NO_DEMAND, pulses=())
    return state._replace(plan=NO_PLAN, demand=NO_DEMAND, pulses=(), fired_t_ns=-1, misfires=0)


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


def _check_is_due(state: State, t_ns: int) -> bool:
    """Whether enough of the stroke has passed to tell combustion from misfire."""
    stroke_ns = state.set_points.point.stroke_s * 1e9
    return t_ns - state.fired_t_ns >= MISFIRE_CHECK_FRACTION * stroke_ns


def _has_misfired(params: Params, state: State, motion: Motion) -> bool:
    """Compare the speed reached since the dead centre with that of a burnt charge.

    Half-way between the speeds with this charge and with none, by the stroke's map; without one
    v = v_mid sin(pi t / T), scaled by the dead centre from which the piston started.
    """
    point = state.set_points.point
    if params.model is not None and params.model.fits:
        fuel_kg = state.burnt_kg[motion.side]
        with_charge, without = trimming.speeds(
            params.model, motion, state.set_points.load_n_s_m, fuel_kg
        )
        return motion.direction * motion.v_m_s < 0.5 * (with_charge + without)
    scale = motion.tdc_m / state.set_points.tdc_ref_m
    expected = point.v_mid_m_s * scale * math.sqrt(0.5)  # sin(pi / 4)
    return motion.direction * motion.v_m_s < MISFIRE_SPEED_RATIO * expected


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
) -> tuple[Any, Demand]:
    """Level 3: the fuel for the dead centre ahead; after a start first the steady fuel."""
    config, point, law = params.config, set_points.point, state.law
    if state.mode is Mode.MOTORING or state.fired_strokes < config.start.open_strokes:
        demand = Demand(point.fuel_kg, point.v_mid_m_s)
    else:
        most = config.limits.fuel_max_kg * set_points.throttle
        facts = StrokeFacts(
            set_points.tdc_ref_m, motion.tdc_m, motion.v_mid_m_s, point,
            config.limits.fuel_min_kg, most, set_points.load_n_s_m,
            1 if motion.direction > 0 else 0, state.burnt_kg, params.model,
        )  # fmt: skip
        law, demand = LAWS[state.law_name].step(config, law, facts)
    return law, safety.limit_fuel(config.limits, set_points.throttle, demand)


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
