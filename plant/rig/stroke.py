"""The end of one stroke and the start of the next, at the instant of the dead centre itself."""

from __future__ import annotations

from plant.engines.fast.combustion import (
    LEFT,
    RIGHT,
    SIDES,
    Stroke,
    efficiency,
    energy_j,
    misfire_reason,
)
from plant.engines.fast.linear import CONTACT as TOUCH
from plant.engines.fast.paths import latches, net_force_n, path_of, remaining_s
from plant.params import PlantParams
from plant.rig import actuation, disturbances
from plant.rig.actuation import Injector
from plant.rig.disturbances import Due, Edge, Held
from plant.rig.events import AT_REST, CONTACT, DISTURBANCE, IN_MOTION, MISFIRE, Event
from plant.rig.machine import obey
from plant.rig.state import DeadCentre, PlantState

# Smaller than this from its equilibrium, and slower, an unfired piston is at rest.
REST_M = 1.0e-6
REST_M_S = 1.0e-3


def end_stroke(
    p: PlantParams, s: PlantState, t_ns: float, stop: int, *, held: Held, events: list[Event]
) -> PlantState:
    """Take the piston through a dead centre or a contact: scavenge, fire, reverse, or rest."""
    engine = p.engine
    direction = s.stroke.direction
    if stop == TOUCH:
        s = s._replace(v_m_s=-engine.restitution * s.v_m_s, contacts=s.contacts + 1)
        text = f"piston against the {SIDES[_side(direction)]} head"
        events.append(Event(round(t_ns), CONTACT, text))
    net = net_force_n(engine, s.x_m, s.machine.force_n)
    onward = net * direction
    slack = engine.rest_stiffness_n_m * REST_M
    if stop != TOUCH and onward > slack:
        return _carry_on(p, s)
    s, taken = _count(p, s, t_ns, held, events)
    pinned = onward > 0.0 if stop == TOUCH else abs(net) <= slack
    if s.stroke.energy_j == 0.0 and pinned and abs(s.v_m_s) <= REST_M_S:
        s = come_to_rest(s, round(t_ns), events)
    return _expect(p, _with_path(p, s), taken)


def _side(direction: int) -> int:
    return RIGHT if direction > 0 else LEFT


def _carry_on(p: PlantParams, s: PlantState) -> PlantState:
    """Velocity vanished but the piston is pushed on: no dead centre, though the charge is spent."""
    spent = s.stroke._replace(energy_j=0.0, latched=False)
    return _with_path(p, s._replace(stroke=spent))


def _count(
    p: PlantParams, s: PlantState, t_ns: float, held: Held, events: list[Event]
) -> tuple[PlantState, tuple[Edge, ...]]:
    """Enter the dead centre and begin the next stroke with what burns at it."""
    dc_ns = round(t_ns)
    side = _side(s.stroke.direction)
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, dc_ns, s.tau_s)
    s = s._replace(disturbances=d, tau_s=0.0)
    s = _begin_at_once(p, s, taken, held=held, t_ns=dc_ns, events=events)
    s, fuel_kg = _burn(p, s, side, t_ns, events)
    return start_stroke(p, s, -s.stroke.direction, dc_ns, fuel_kg), taken


def start_stroke(
    p: PlantParams, s: PlantState, direction: int, dc_ns: int, fuel_kg: float
) -> PlantState:
    """Begin a stroke at a dead centre, `fuel_kg` burning at it."""
    number = s.dead_centre.number + 1
    eta = efficiency(p, s.disturbances.efficiency, number) if fuel_kg else 1.0
    energy = energy_j(p.engine, fuel_kg, eta)
    latched = latches(p.engine, energy, s.machine.load_coefficient_n_s_m, s.machine.force_n)
    return s._replace(
        stroke=Stroke(number, direction, dc_ns, s.x_m, fuel_kg, eta, energy, latched),
        dead_centre=DeadCentre(number, dc_ns, s.x_m, fuel_kg, eta),
        v_m_s=0.0 if latched else s.v_m_s,
        tau_s=0.0,
    )


def first_stroke(
    p: PlantParams, s: PlantState, fuel_kg: float, held: Held, events: list[Event]
) -> PlantState:
    """Begin a run at a left dead centre at t = 0, with disturbances acting there already."""
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, 0, 0.0)
    s = _begin_at_once(p, s._replace(disturbances=d), taken, t_ns=0, held=held, events=events)
    d, cause = disturbances.take_misfire(s.disturbances)
    if cause:
        events.append(Event(0, MISFIRE, f"{SIDES[LEFT]}: forced, no {cause}"))
    s = start_stroke(p, s._replace(disturbances=d), 1, 0, 0.0 if cause else fuel_kg)
    return _expect(p, _with_path(p, s), taken)


def _burn(
    p: PlantParams, s: PlantState, side: int, t_ns: float, events: list[Event]
) -> tuple[PlantState, float]:
    """Decide on the charge of that side, then scavenge it; returns the fuel that burns."""
    injector = Injector(p.flow_kg_s, p.dead_time_ns)
    pulses = actuation.advance(s.pulses, injector, t_ns)
    fuel_kg = actuation.fuel_until(pulses, injector, side, t_ns)
    compressed = s.x_m * s.stroke.direction > 0.0
    reason = misfire_reason(p, fuel_kg, pulses.spark_ns[side], t_ns, compressed)
    d, cause = disturbances.take_misfire(s.disturbances)
    if cause:
        reason = f"forced, no {cause}"
    intended = fuel_kg > 0.0 or pulses.spark_ns[side] >= 0 or s.stroke.fuel_kg > 0.0
    if reason and (intended or cause):
        events.append(Event(round(t_ns), MISFIRE, f"{SIDES[side]}: {reason}"))
    pulses = actuation.scavenge(pulses, injector, side, t_ns)
    return s._replace(pulses=pulses, disturbances=d), 0.0 if reason else fuel_kg


def _begin_at_once(
    p: PlantParams,
    s: PlantState,
    taken: tuple[Edge, ...],
    *,
    t_ns: int,
    held: Held,
    events: list[Event],
) -> PlantState:
    """Apply the edges that act at the dead centre itself, before its combustion."""
    for edge in taken:
        if edge.fraction == 0.0:
            due = Due(s.tau_s, edge.event, edge.begins)
            s = apply_due(p, s, due, t_ns=t_ns, held=held, events=events)
    return s


def _expect(p: PlantParams, s: PlantState, taken: tuple[Edge, ...]) -> PlantState:
    """Enter the edges that act later in the stroke that has just begun."""
    later = [edge for edge in taken if edge.fraction > 0.0]
    if not later:
        return s
    duration = remaining_s(p.engine, s.stroke, s.path, x=s.x_m, v=s.v_m_s, tau=s.tau_s)
    d = s.disturbances
    for edge in later:
        tau = s.tau_s + edge.fraction * duration
        d = disturbances.put(d, Due(tau, edge.event, edge.begins))
    return s._replace(disturbances=d)


def apply_due(
    p: PlantParams, s: PlantState, due: Due, *, t_ns: int, held: Held, events: list[Event]
) -> PlantState:
    """Begin or end a disturbance now; a changed load takes effect through `repath`."""
    d = disturbances.apply(p.events, s.disturbances, due, held)
    what = "begins" if due.begins else "ends"
    kind = p.events[due.event].kind
    events.append(Event(t_ns, DISTURBANCE, f"{p.names[due.event]} ({kind}) {what}"))
    return s._replace(disturbances=d, machine=obey(p, s.machine.order, d.load_scale))


def repath(p: PlantParams, s: PlantState, t_ns: int, events: list[Event]) -> PlantState:
    """Let a changed machine act from here on; wake a resting piston if it is pushed."""
    if s.moving:
        return s if s.stroke.latched else _with_path(p, s)
    net = net_force_n(p.engine, s.x_m, s.machine.force_n)
    inward = abs(s.x_m) < p.engine.contact_m or net * s.x_m < 0.0
    if abs(net) <= p.engine.rest_stiffness_n_m * REST_M or not inward:
        return s
    direction = 1 if net > 0.0 else -1
    events.append(Event(t_ns, IN_MOTION, "the machine moves the piston from rest"))
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, t_ns, s.tau_s)
    stroke = Stroke(s.dead_centre.number, direction, t_ns, s.x_m)
    s = s._replace(moving=True, tau_s=0.0, stroke=stroke, disturbances=d)
    s = _begin_at_once(p, s, taken, t_ns=t_ns, held=Held(s.x_m, s.v_m_s), events=events)
    return _expect(p, _with_path(p, s), taken)


def come_to_rest(s: PlantState, t_ns: int, events: list[Event]) -> PlantState:
    """Stop the piston where it is."""
    events.append(Event(t_ns, AT_REST, f"piston at rest at {s.x_m * 1e3:.3f} mm"))
    spent = s.stroke._replace(energy_j=0.0, latched=False)
    return s._replace(v_m_s=0.0, moving=False, stroke=spent)


def _with_path(p: PlantParams, s: PlantState) -> PlantState:
    c, force = s.machine.load_coefficient_n_s_m, s.machine.force_n
    return s._replace(path=path_of(p.engine, s.stroke, c, force, x=s.x_m, v=s.v_m_s, tau=s.tau_s))
