"""Inside a tick with a unit: what it is told, and what its dead centres mean. Pure functions."""

from __future__ import annotations

from typing import NamedTuple

from plant.engines.fast.combustion import LEFT, RIGHT, SIDES, Stroke, efficiency
from plant.engines.fmu.turning import turning_point
from plant.params import PlantParams
from plant.rig import actuation, disturbances
from plant.rig.actuation import Injector
from plant.rig.disturbances import Disturbances, Due, Held
from plant.rig.events import AT_REST, CONTACT, DISTURBANCE, IN_MOTION, MISFIRE, Event
from plant.rig.machine import obey
from plant.rig.state import DeadCentre, PlantState

NO_SPARK_S = -1.0
SECOND_NS = 1e9
_HEAD_GAP_M = 1.0e-4
_HALF_NS = 0.5

Outputs = dict[str, float]
Inputs = tuple[float, float, float, float, float, float]


class Reached(NamedTuple):
    """The dead centre that lies in the part of a tick just done.

    times: how many there were, more than one when the piston bounces
    burnt: whether the unit burnt its charge, None when it does not say
    """

    t_ns: int
    x_m: float
    times: int
    contacts: int
    burnt: bool | None


def inputs(p: PlantParams, s: PlantState, injector: Injector, until_ns: int) -> Inputs:
    """What the unit is told for a step to `until_ns`.

    A charge out of range is no charge. A forced misfire holds back spark or fuel; a varying
    efficiency scales the fuel, for E is proportional to both (thesis eq. 5.36).
    """
    dis = _preview(p, s.disturbances, until_ns)
    ahead = s.pulses
    if ahead.next_edge_ns <= until_ns:
        ahead = actuation.advance(ahead, injector, until_ns)
    eta = efficiency(p, dis.efficiency, s.dead_centre.number + 1)
    fuels, sparks = [], []
    for side in (LEFT, RIGHT):
        fuel = actuation.fuel_until(ahead, injector, side, until_ns)
        spark_ns = ahead.spark_ns[side]
        burns = p.fuel_min_kg <= fuel <= p.fuel_max_kg and not dis.misfires
        fuels.append(eta * fuel if burns else 0.0)
        sparks.append(spark_ns / SECOND_NS if spark_ns >= 0 and burns else NO_SPARK_S)
    _, load, force = s.machine
    return force, load, fuels[0], fuels[1], sparks[0], sparks[1]


def first_efficiency(p: PlantParams, s: PlantState) -> float:
    """Return the efficiency of the combustion with which a run begins."""
    return efficiency(p, _preview(p, s.disturbances, 0).efficiency, 1)


def _preview(p: PlantParams, dis: Disturbances, until_ns: int) -> Disturbances:
    """Disturbances as they are at a dead centre before `until_ns`, if one should come."""
    if dis.next_edge >= len(p.edges) or p.edges[dis.next_edge].at_ns > until_ns:
        return dis
    dis, taken = disturbances.start_stroke(p.edges, dis, until_ns, 0.0)
    for edge in taken:
        if edge.fraction == 0.0:
            due = Due(0.0, edge.event, edge.begins)
            dis = disturbances.apply(p.events, dis, due, Held(0.0, 0.0))
    return dis


def reached(
    p: PlantParams, s: PlantState, last: Outputs, now: Outputs, t_ns: int, h: float
) -> Reached | None:
    """Find the dead centre of a step: as the unit tells it, else from the turn of the velocity."""
    burnt = now["fuel_burnt_kg"] > 0.0 if "fuel_burnt_kg" in now else None
    if "dead_centres" in now:
        count = int(now["dead_centres"] - last["dead_centres"])
        if count <= 0:
            return None
        dc_ns, x = round(now["dc_t_s"] * SECOND_NS), now["dc_x_m"]
    else:
        turn = turning_point(s.x_m, s.v_m_s, now["x_m"], now["v_m_s"], h)
        if turn is None:
            return None
        count, dc_ns, x = 1, t_ns + round(turn[0] * SECOND_NS), turn[1]
    contacts = int(abs(x) >= p.engine.half_stroke_m - _HEAD_GAP_M)
    if "contacts" in now:
        contacts = int(now["contacts"] - last["contacts"])
    return Reached(dc_ns, x, count, contacts, burnt)


def awaits_fraction(p: PlantParams, s: PlantState, t_ns: int) -> bool:
    """Tell whether a disturbance acts inside the stroke that begins at t_ns."""
    last = len(p.edges)
    return any(
        p.edges[n].at_ns <= t_ns and p.edges[n].fraction > 0.0
        for n in range(s.disturbances.next_edge, last)
    )


def dead_centre(
    p: PlantParams,
    s: PlantState,
    r: Reached,
    stroke_s: float,
    events: list[Event],
    *,
    every: bool = True,
) -> PlantState:
    """Enter the dead centre, its charge and its disturbances, and begin the next stroke.

    Parameters: stroke_s : how long that stroke lasts if nothing disturbs it
        every : whether every stroke is to fire while the engine runs
    """
    side = RIGHT if s.stroke.direction > 0 else LEFT
    touch = Event(r.t_ns, CONTACT, f"piston against the {SIDES[side]} head")
    events.extend([touch] * r.contacts)
    lasted = (r.t_ns - s.stroke.start_ns) / SECOND_NS
    dis, taken = disturbances.start_stroke(p.edges, s.disturbances, r.t_ns, lasted)
    s = s._replace(disturbances=dis)
    for edge in taken:
        due = Due(edge.fraction * stroke_s, edge.event, edge.begins)
        if edge.fraction == 0.0:
            s = apply(p, s, due, r.t_ns, Held(s.x_m, s.v_m_s), events)
        else:
            s = s._replace(disturbances=disturbances.put(s.disturbances, due))
    s, fuel_kg = _burn(p, s, r, side, events, every=every)
    number = s.dead_centre.number + r.times
    eta = efficiency(p, s.disturbances.efficiency, number) if fuel_kg else 1.0
    return s._replace(
        contacts=s.contacts + r.contacts,
        stroke=Stroke(number, -s.stroke.direction, r.t_ns, r.x_m, fuel_kg, eta),
        dead_centre=DeadCentre(number, r.t_ns, r.x_m, fuel_kg, eta),
    )


def _burn(
    p: PlantParams, s: PlantState, r: Reached, side: int, events: list[Event], *, every: bool
) -> tuple[PlantState, float]:
    """Say what became of the charge of that side, then scavenge it; returns the fuel burnt."""
    injector = Injector(p.flow_kg_s, p.dead_time_ns)
    pulses = actuation.advance(s.pulses, injector, r.t_ns)
    fuel_kg = actuation.fuel_until(pulses, injector, side, r.t_ns)
    spark_ns = pulses.spark_ns[side]
    dis, cause = disturbances.take_misfire(s.disturbances)
    reason = f"forced, no {cause}" if cause else _objection(p, fuel_kg, spark_ns, r)
    intended = fuel_kg > 0.0 or spark_ns >= 0 or (every and s.stroke.fuel_kg > 0.0)
    if reason and (intended or cause):
        events.append(Event(r.t_ns, MISFIRE, f"{SIDES[side]}: {reason}"))
    pulses = actuation.scavenge(pulses, injector, side, r.t_ns)
    return s._replace(pulses=pulses, disturbances=dis), 0.0 if reason else fuel_kg


def _objection(p: PlantParams, fuel_kg: float, spark_ns: int, r: Reached) -> str:
    """Tell why a charge did not burn; an empty string when it did."""
    if fuel_kg <= 0.0:
        return "no fuel"
    if not p.fuel_min_kg <= fuel_kg <= p.fuel_max_kg:
        return f"fuel out of range ({fuel_kg * 1e6:.4f} mg)"
    if spark_ns < 0:
        return "no spark"
    if r.burnt is None:
        early_ns = r.t_ns - spark_ns
        late = early_ns > p.spark_window_ns
        return f"early spark ({early_ns * 1e-6:.3f} ms before the dead centre)" if late else ""
    return "" if r.burnt else "not burnt by the unit"


def apply(
    p: PlantParams, s: PlantState, due: Due, t_ns: int, held: Held, events: list[Event]
) -> PlantState:
    """Begin or end a disturbance; a changed load acts from the unit's next step on."""
    dis = disturbances.apply(p.events, s.disturbances, due, held)
    what = "begins" if due.begins else "ends"
    text = f"{p.names[due.event]} ({p.events[due.event].kind}) {what}"
    events.append(Event(t_ns, DISTURBANCE, text))
    return s._replace(disturbances=dis, machine=obey(p, s.machine.order, dis.load_scale))


def apply_dues(
    p: PlantParams, s: PlantState, now_ns: int, held: Held, events: list[Event]
) -> PlantState:
    """Apply what is due by now."""
    while s.stroke.start_ns + s.disturbances.due_s * SECOND_NS <= now_ns + _HALF_NS:
        dis, due = disturbances.pop(s.disturbances)
        s = apply(p, s._replace(disturbances=dis), due, now_ns, held, events)
    return s


def note_rest(s: PlantState, t_ns: int, events: list[Event]) -> PlantState:
    """Say when the piston sets off or comes to rest."""
    moving = s.v_m_s != 0.0
    if moving and not s.moving:
        events.append(Event(t_ns, IN_MOTION, "the machine moves the piston from rest"))
    elif s.moving and not moving:
        events.append(Event(t_ns, AT_REST, f"piston at rest at {s.x_m * 1e3:.3f} mm"))
    return s._replace(moving=moving)
