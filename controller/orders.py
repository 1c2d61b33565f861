"""Orders in and out: what an operator asks for, what the machine and the valves are told."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from controller import actuator
from controller.actuator import Machine
from controller.knowledge import motoring_force
from controller.mode.start_restart import GENERATING, MOTORING, Mode
from controller.motion import drive
from controller.motion.choice import refusal
from controller.motion.drive import Drive
from controller.motion.fuelling import Fuelling
from controller.observe.estimate import NOTHING, Motion, Observation
from controller.state import Inputs, Params, State, view_of
from controller.supervisory import Events, SetPoints
from controller.timing import port, valves
from controller.timing.injection import plan_injection, retime_injection
from controller.timing.plan import Plan, PlannedPulse
from controller.timing.port import Film
from controller.timing.valves import ValveTiming
from hil.rounding import nearest
from hil.values import replace
from hil.wire.commands import OperatorCommand
from hil.wire.messages import GENERATOR, MOTOR, ValveMove
from hil.wire.pulses import may_fire

_CREEP_M_S: Final = 1e-3


def obey(params: Params, state: State, command: OperatorCommand) -> tuple[State, Events]:
    """Take an operator's command; start and stop are facts for the mode table."""
    reason = _refusal(params, command)
    if reason:
        return state, (("command-refused", reason),)
    told: Events = ()
    if command.kind == "set-point":
        set_points, told = params.supervisor.changed(
            state.set_points, command.number("tdc_ref_m"), command.number("target_power_w")
        )
        state = replace(state, set_points=set_points)
    if command.kind == "mark":
        return state, (("mark", f"{command.text('text')} (from {command.origin})"),)
    law = command.text("law")
    if law is not None:
        state = with_law(params, state, law)
    return state, (("command", command.describe()), *told)


def _refusal(params: Params, command: OperatorCommand) -> str:
    """Why a command cannot be taken; an empty string when it can."""
    tdc_m, law = command.number("tdc_ref_m"), command.text("law")
    most_m = params.bounds.limit_m - params.config.supervisory.tdc_room_m
    if tdc_m is not None and tdc_m > most_m:
        return f"tdc_ref_m={tdc_m:g} from {command.origin}: accepted up to {most_m:g}"
    reason = "" if law is None else refusal(law, params.laws, params.stroke_map)
    return f"{reason} (from {command.origin})" if reason else ""


def with_law(params: Params, state: State, name: str) -> State:
    """Let another law go on from here; in a mode without one it will begin afresh."""
    view = view_of(params, state.motion, NOTHING, state.set_points, state.fuelling, float("nan"))
    return replace(state, fuelling=state.fuelling.handed_over(name, params.law_of(name), view))


def inject(
    params: Params, state: State, motion: Motion, t_ns: i64, stroke_s: float, plan: Plan,
    fuel_kg: float,
) -> Plan:  # fmt: skip
    """Level 4: the injection of a fuel that has just been asked for, at mid-stroke."""
    timings, period_ns = params.timings, params.period_ns
    if params.port is None or state.film is None:
        return plan_injection(timings, motion, t_ns, period_ns, stroke_s, fuel_kg)
    shut_ns = _shut_ns(params, state.fuelling, state.set_points, motion)
    return port.plan(
        params.port, timings, state.film, plan, motion, t_ns, period_ns, stroke_s, fuel_kg, shut_ns
    )


def reinject(
    params: Params, state: State, fuelling: Fuelling, motion: Motion, ends_ns: i64, plan: Plan,
    fuel_kg: float,
) -> Plan:  # fmt: skip
    """Level 4: the same injection with another fuel, as far as that still reaches it.

    Parameters: ends_ns : when it has to be over at the latest, but for `timing.trim_margin_s`
    """
    timings, period_ns = params.timings, params.period_ns
    if params.port is None or state.film is None:
        return retime_injection(timings, plan, ends_ns, motion.t_ns, period_ns, fuel_kg)
    shut_ns = _shut_ns(params, fuelling, state.set_points, motion)
    return port.retime(
        params.port, timings, state.film, plan, motion, ends_ns, period_ns, fuel_kg, shut_ns
    )


def _shut_ns(params: Params, fuelling: Fuelling, set_points: SetPoints, motion: Motion) -> i64:
    """When the intake behind the piston will close, in the stroke to come: by the map's end."""
    stroke_s, stroke_map = set_points.point.stroke_s, params.stroke_map
    end_m, left_s = motion.tdc_m, 0.5 * stroke_s - float(motion.t_ns - motion.mid_t_ns) * 1e-9
    if stroke_map is not None:
        law = params.law_of(fuelling.law_name)
        load = law.load_of(fuelling.law, set_points.load_n_s_m)
        burnt_kg = fuelling.burnt_kg[0] if motion.side == 0 else fuelling.burnt_kg[1]
        z, v, tau = motion.z_m, motion.speed_m_s, motion.tau_s
        end_m, left_s = stroke_map.travel(burnt_kg, load, z, v, tau)
    assert params.port is not None, "asked of an intake port"
    return motion.t_ns + nearest(left_s * 1e9) + params.port.closes_ns(end_m, stroke_s)


def filmed(params: Params, state: State, motion: Motion) -> Film | None:
    """The films of the ports behind a dead centre."""
    film, stroke_s = state.film, state.set_points.point.stroke_s
    if params.port is None or film is None:
        return film
    return port.after_dead_centre(params.port, params.timings, film, state.plan, motion, stroke_s)


def with_valves(
    params: Params, timing: ValveTiming | None, before: Motion, seen: Observation, inputs: Inputs,
    mode: Mode, pulses: tuple[PlannedPulse, ...],
) -> tuple[ValveTiming | None, tuple[PlannedPulse, ...]]:  # fmt: skip
    """Level 4: the valves' edges, and which of all orders this tick has room for.

    A tick in which the plant tells of a valve or a cylinder has one frame less.
    """
    table, told = params.valve_table, inputs.told
    room: i64 = actuator.MAX_PULSES if told is None else actuator.MAX_PULSES - 1
    if table is None or timing is None:
        return timing, pulses if len(pulses) <= room else pulses[:room]
    moved = told if type(told) is ValveMove else None
    timing = valves.observe(table, timing, before, seen.motion, seen.passed.dead_centre, moved)
    if not may_fire(mode):
        return valves.at_rest(timing), pulses
    timing = valves.plan(table, params.timings, timing, seen.t_ns, params.period_ns)
    acts_ns = seen.t_ns + params.timings.act_ticks * params.period_ns
    return valves.to_send(timing, pulses, inputs.tick, acts_ns, room)


def machine_order(
    params: Params, driving: Drive, mode: Mode, seen: Observation, set_points: SetPoints,
    load_n_s_m: float,
) -> tuple[Drive, Machine]:  # fmt: skip
    """The machine's order in this mode."""
    motion, cycle = seen.motion, params.cycle
    if cycle is not None and (mode is GENERATING or mode is MOTORING):
        if seen.passed.dead_centre:
            driving = drive.learn(cycle, driving, motion, set_points.tdc_ref_m)
        motoring_n = params.start.force_n if mode is MOTORING else 0.0
        driving = drive.order(cycle, driving, motion, load_n_s_m, motoring_n)
        if driving.generates:
            return driving, Machine(GENERATOR, 0.0, load_n_s_m)
        return driving, Machine(MOTOR, driving.force_n)
    if mode is MOTORING:
        return driving, _motored(params, motion, set_points.tdc_ref_m)
    full_load = params.supervisor.full_load_n_s_m
    return driving, actuator.machine_for(mode, load_n_s_m, full_load)


def _motored(params: Params, motion: Motion, tdc_ref_m: float) -> Machine:
    """Push in the direction of motion, as hard as the amplitude that is aimed at still asks for.

    A charge that has burnt in part, and was taken for a misfire, may drive the piston to the head:
    what leads beyond half the way from set point to limit is braked away, F = c v.
    """
    start, engine, x, v = params.start, params.engine, motion.x_m, motion.v_m_s
    direction = -1.0 if motion.direction < 0 else 1.0
    if start.constant_force:
        return Machine(MOTOR, direction * start.force_n)
    amplitude = start.amplitude_ratio * tdc_ref_m
    force_n = motoring_force(engine, x, v, direction, amplitude)
    furthest_m = 0.5 * (tdc_ref_m + params.bounds.limit_m)
    brake_n = -motoring_force(engine, x, v, direction, furthest_m)
    if brake_n <= 0.0:
        return Machine(MOTOR, direction * min(start.force_n, max(force_n, 0.0)))
    most_n_s_m = params.supervisor.full_load_n_s_m
    return Machine(GENERATOR, 0.0, min(brake_n / max(abs(v), _CREEP_M_S), most_n_s_m))
