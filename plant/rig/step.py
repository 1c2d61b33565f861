"""One tick of the plant: orders taken, motion solved, every instant inside it honoured.

step(params, state, command) -> (state, events), whatever the engine. An ordinary tick is one
evaluation of a closed form; a tick with an edge, a dead centre or a contact inside goes through
`_busy_tick`, as does every tick of an engine that has no closed form.
"""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from hil.rounding import nearest
from hil.values import replace
from plant.engines.machine import Machine
from plant.engines.protocol import (
    AT_DEAD_CENTRE,
    OF_ITS_OWN,
    Ahead,
    Inputs,
    Motion,
    Moved,
)
from plant.rig import actuation, charges, disturbances, indicator, orders, valves
from plant.rig.actuation import Actuation
from plant.rig.disturbances import Held
from plant.rig.events import VALVE_CONTACT, Event
from plant.rig.params import PlantParams
from plant.rig.state import Command, PlantState
from plant.rig.stroke import act, end_stroke, moved, read, take_due

_NO_VALVES: Final[tuple[int, ...]] = ()
_NO_FUEL: Final = (0.0, 0.0)
_NO_SPARK: Final[tuple[i64, i64]] = (-1, -1)
_NO_EVENTS: Final[tuple[Event, ...]] = ()

Events = tuple[Event, ...]


def step(p: PlantParams, s: PlantState, command: Command | None) -> tuple[PlantState, Events]:
    """Integrate exactly one tick with the command now in force.

    Parameters: command : Command, or None for a tick without a valid one
    Returns: the state at the start of the next tick, and what happened in this one, in order
    """
    events: list[Event] = []
    if p.instrumented:
        s = told(p, s)
    if s.pulses.valves.told:  # with the sample of this tick
        s = s.but(pulses=actuation.with_valves(s.pulses, valves.after_telling(s.pulses.valves)))
    if p.delay_ticks:
        s, command = orders.delayed(p, s, command)
    before, begun = s.machine, s
    s = orders.follow(p, s, command, events)
    if s.machine is not before and _differ(s.machine, before):
        s = act(p, s, s.tick * p.period_ns, events)
    after = _quiet_tick(p, s)
    if after is None:
        after = _busy_tick(p, s, events)
    if p.instrumented:
        after = observed(p, begun, after)
    return after, tuple(events) if events else _NO_EVENTS


def _differ(a: Machine, b: Machine) -> bool:
    return a.load_coefficient_n_s_m != b.load_coefficient_n_s_m or a.force_n != b.force_n


def _quiet_tick(p: PlantParams, s: PlantState) -> PlantState | None:
    """Move through a tick in which the motion takes its course; None when it may not.

    The edge of a line is nothing to an engine that looks at its charge at the dead centre.
    """
    if s.motion.tau_s + p.dt_s >= s.disturbances.due_s:
        return None
    end_ns, pulses = (s.tick + 1) * p.period_ns, s.pulses
    at_edge = pulses.table.next_edge_ns <= end_ns
    if at_edge and p.engine.ignition != AT_DEAD_CENTRE:
        return None
    motion = p.engine.coast(s.motion, p.dt_s)
    if motion is None:
        return None
    if p.injector.wall is not None:
        pulses = charges.taken_in(p, s, motion, float(s.tick * p.period_ns), p.dt_s)
    if at_edge:
        before = pulses
        pulses = actuation.advance(before, p.injector, float(end_ns))
        pulses = charges.placed(p, s, before, pulses, s.motion, motion, float(end_ns))
    return _at_next_tick(s, motion, pulses)


def _at_next_tick(s: PlantState, motion: Motion, pulses: Actuation) -> PlantState:
    return PlantState(
        s.tick + 1, motion, s.stroke, s.machine, pulses, s.disturbances, s.dead_centre,
        s.lit, s.stale, s.latch, s.contacts, s.waiting, s.manifold, s.instruments,
    )  # fmt: skip


def _busy_tick(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Move through a tick from one instant of note to the next."""
    held, held_from, number = Held(s.motion.x_m, s.motion.v_m_s), s.motion, s.stroke.number
    now_ns = float(s.tick * p.period_ns)
    used_s, part, at_end = 0.0, 0, False
    while not at_end:
        ahead = _ahead(p, s, now_ns, used_s, part)
        it = p.engine.advance(s.motion, _inputs(p, s, ahead), ahead)
        if p.injector.wall is not None:
            s = s.but(pulses=charges.taken_in(p, s, it.motion, now_ns, (it.t_ns - now_ns) * 1e-9))
        s = _arrive(p, s, it, held, events)
        now_ns, used_s, part, at_end = it.t_ns, it.used_s, part + 1, it.at_end
    end_ns = (s.tick + 1) * p.period_ns
    pulses = actuation.advance(s.pulses, p.injector, float(end_ns), p.valves)
    stroke = s.stroke
    if stroke.number != number:
        held_from = Motion(stroke.start_x_m, 0.0, 0.0, True, stroke.direction, None)
    pulses = charges.placed(p, s, s.pulses, pulses, held_from, s.motion, float(end_ns))
    return _at_next_tick(s, s.motion, pulses)


def _ahead(p: PlantParams, s: PlantState, now_ns: float, used_s: float, part: int) -> Ahead:
    """See what lies ahead in this tick."""
    start_ns = s.tick * p.period_ns
    end_ns = until_ns = start_ns + p.period_ns
    due_s = s.disturbances.due_s
    due_ns = float(s.stroke.start_ns) + due_s * 1e9
    if p.engine.splits and now_ns < due_ns < float(end_ns):
        until_ns = min(max(nearest(due_ns), nearest(now_ns) + 1), end_ns)
    return Ahead(
        start_ns=start_ns, end_ns=end_ns, dt_s=p.dt_s, now_ns=now_ns, used_s=used_s,
        until_ns=until_ns, edge_ns=s.pulses.next_edge_ns, due_s=due_s, due_ns=due_ns,
        stroke_ns=s.stroke.start_ns, part=part,
    )  # fmt: skip


def _inputs(p: PlantParams, s: PlantState, ahead: Ahead) -> Inputs:
    """What this engine is told for its next part of the tick."""
    if p.engine.ignition == OF_ITS_OWN:
        fuel_kg, spark_ns = _charges_ahead(p, s, ahead.until_ns)
        return Inputs(s.machine, _NO_VALVES, fuel_kg, spark_ns)
    levels = s.pulses.valves.levels if p.engine.valves else _NO_VALVES
    share = s.manifold.pressure_pa(s.tick * p.period_ns) / p.intake.full_pa
    share *= p.config.disturbance.manifold_scale
    return Inputs(s.machine, levels, _NO_FUEL, _NO_SPARK, share)


def _charges_ahead(
    p: PlantParams, s: PlantState, until_ns: i64
) -> tuple[tuple[float, float], tuple[i64, i64]]:
    """Return both charges as they will be by then, for an engine that burns them of its own.

    A charge out of range is no charge. A forced misfire holds back spark or fuel; a varying
    efficiency scales the fuel, for E is proportional to both (thesis eq. 5.36).
    """
    d = disturbances.preview(p.edges, p.events, s.disturbances, until_ns)
    pulses = s.pulses
    if pulses.table.next_edge_ns <= until_ns:
        pulses = actuation.advance(pulses, p.injector, float(until_ns))
    eta = charges.efficiency(p, d.efficiency, s.dead_centre.number + 1)
    for side in (charges.LEFT, charges.RIGHT):
        if pulses.spark_ns[side] != s.pulses.spark_ns[side]:
            pulses = charges.delayed(p, pulses, side)
    fuels, sparks = [0.0, 0.0], pulses.spark_ns
    for side in (charges.LEFT, charges.RIGHT):
        fuel = actuation.fuel_until(pulses, p.injector, side, float(until_ns))
        fuel = charges.metered_kg(p, fuel, s.dead_centre.number + 1, float(until_ns))
        if p.fuel_min_kg <= fuel <= p.fuel_max_kg and not d.misfires:
            fuels[side] = eta * fuel
        else:
            sparks = actuation.with_spark(sparks, side, -1)
    return (fuels[charges.LEFT], fuels[charges.RIGHT]), sparks


def _arrive(
    p: PlantParams, s: PlantState, it: Moved, held: Held, events: list[Event]
) -> PlantState:
    """Do what there is to be done where the engine has come to."""
    if p.valves.by_lines:
        s = _look_at_valves(p, s, it, events)
    if it.stop is not None:
        return end_stroke(p, s, it.motion, it.stop, nearest(it.t_ns), held, events)
    s = moved(p, s, it.motion, nearest(it.t_ns), events)
    if it.at_edge:
        s = _pass_edge(p, s, events)
    if it.at_due:
        s = take_due(p, s, nearest(it.t_ns), held, events)
    return s


def _look_at_valves(p: PlantParams, s: PlantState, it: Moved, events: list[Event]) -> PlantState:
    """Tell of a valve that the piston touches: a contact, once for each time that it does."""
    before = s.pulses.valves
    struck = valves.strike(before, p.valves, p.engine.gaps_m(it.motion))
    if struck == before.struck:
        return s
    new = valves.names_of(struck & ~before.struck)
    events.extend(Event(nearest(it.t_ns), VALVE_CONTACT, f"piston against {v}") for v in new)
    s = replace(s, contacts=s.contacts + len(new))
    return s.but(pulses=actuation.with_valves(s.pulses, valves.with_struck(before, struck)))


def _pass_edge(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Let the lines change their levels; a spark lights its charge at once."""
    before = s.pulses.spark_ns
    pulses = actuation.advance(s.pulses, p.injector, float(s.pulses.next_edge_ns), p.valves)
    s = s.but(pulses=pulses)
    for side in (charges.LEFT, charges.RIGHT):
        if pulses.spark_ns[side] > before[side]:
            s = charges.spark(p, s, side, events)
    return s


def told(p: PlantParams, s: PlantState) -> PlantState:
    """The state once the sample of its tick is sent: the oldest cycle is told, unless a valve was.

    Only one of both has room beside the other frames of a tick.
    """
    if not s.instruments.told or (s.pulses.valves.told and p.valves.by_lines):
        return s
    return s.but(instruments=indicator.after_telling(s.instruments))


def observed(p: PlantParams, before: PlantState, after: PlantState) -> PlantState:
    """Look at the end of a tick."""
    if p.config.indicator.on:
        after = read(p, after, after.motion, float(after.tick * p.period_ns))
    if p.config.winding.on:
        speeds = (before.v_m_s, after.v_m_s)
        warmer = indicator.warmed(
            after.instruments, p.config.winding, after.machine, speeds, p.dt_s
        )
        after = after.but(instruments=warmer)
    return after
