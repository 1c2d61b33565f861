"""Level 1: the operating mode, from the samples, the combustion and the operator's commands."""

from __future__ import annotations

import math

from controller import safety, supervisory, trimming
from controller.estimate import Motion, Passed
from controller.laws import LAWS
from controller.laws.interface import NO_DEMAND
from controller.start_restart import Facts, Mode, next_mode
from controller.state import Inputs, Params, State
from controller.timing import NO_PLAN
from hil.wire.commands import OperatorCommand

MISFIRE_CHECK_FRACTION = 0.25
"""Part of a stroke after which the piston's speed tells whether the charge has burnt."""

MISFIRE_SPEED_RATIO = 0.6
"""Below this share of the expected speed it has not: the air springs alone give 0.2 to 0.45."""

REST_SPEED_M_S = 2e-3
REST_POSITION_M = 2e-3


def decide(
    params: Params,
    state: State,
    inputs: Inputs,
    motion: Motion,
    passed: Passed,
    stale: int,
    t_ns: int,
) -> tuple[Mode, State, tuple[tuple[str, str], ...]]:
    """Judge the combustion, take the operator's command, apply the mode table.

    Returns: the mode from now on, the state with what a change of it resets, events (code, text)
    """
    if inputs.command is None and _is_uneventful(params, state, motion, passed, stale, t_ns):
        return state.mode, state, ()
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


def _is_uneventful(
    params: Params, state: State, motion: Motion, passed: Passed, stale: int, t_ns: int
) -> bool:
    """Whether no rule can apply: most ticks of a running engine, told by a few comparisons."""
    return (
        state.mode is Mode.GENERATING
        and stale == 0
        and not passed.dead_centre
        and (state.fired_t_ns < 0 or not _check_is_due(state, t_ns))
        and state.misfires < params.config.limits.misfires
        and -params.limit_m <= motion.x_m <= params.limit_m
    )


def _obey(
    params: Params, state: State, command: OperatorCommand
) -> tuple[State, tuple[tuple[str, str], ...]]:
    """Take an operator's command; start and stop are facts for the mode table."""
    tdc_m, law = command.number("tdc_ref_m"), command.text("law")
    if tdc_m is not None and safety.is_beyond(params.limit_m, tdc_m):
        text = f"tdc_ref_m={tdc_m:g} from {command.origin}: accepted up to {params.limit_m:g}"
        return state, (("command-refused", text),)
    if command.kind == "set-point":
        set_points = supervisory.change(
            params.config,
            params.engine,
            state.set_points,
            tdc_m,
            command.number("target_power_w"),
        )
        state = state._replace(set_points=set_points)
    if law is not None:
        reason = trimming.refusal(law, params.model)
        if reason:
            return state, (("command-refused", f"{reason} (from {command.origin})"),)
        state = _change_law(params, state, law)
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
    return state._replace(
        plan=NO_PLAN, demand=NO_DEMAND, pulses=(), fired_t_ns=-1, misfires=0, beyond_kg=0.0
    )


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
