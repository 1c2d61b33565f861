"""The end of one stroke and the start of the next, at the instant of the dead centre itself."""

from __future__ import annotations

from mypy_extensions import i64

from hil.rounding import nearest
from hil.values import replace
from plant.engines.protocol import BY_SPARK, NO_CHARGE, SLOW_SIGNALS, Charge, Motion, Stop
from plant.rig import charges, disturbances, indicator
from plant.rig.charges import LEFT, RIGHT, SIDES
from plant.rig.disturbances import PRE_IGNITION, Due, Edge, Held
from plant.rig.events import AT_REST, CONTACT, DISTURBANCE, IN_MOTION, Event
from plant.rig.orders import obey
from plant.rig.params import PlantParams
from plant.rig.state import DeadCentre, PlantState, Stroke


def end_stroke(
    p: PlantParams,
    s: PlantState,
    motion: Motion,
    stop: Stop,
    now_ns: i64,
    held: Held,
    events: list[Event],
) -> PlantState:
    """Take the piston through a dead centre or a contact: scavenge, fire, reverse, or rest.

    Parameters: motion, now_ns : where the engine stands, which may be past the stop
    """
    dc_ns = nearest(stop.t_ns)
    side = RIGHT if s.stroke.direction > 0 else LEFT
    if stop.contacts:
        touch = Event(dc_ns, CONTACT, f"piston against the {SIDES[side]} head")
        events.extend([touch] * stop.contacts)
        s = replace(s, contacts=s.contacts + stop.contacts)
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, dc_ns, stop.lasted_s)
    s = s.but(disturbances=d)
    if p.engine.ignition != BY_SPARK:
        s = begin_at_once(p, s, taken, dc_ns, held, events)
    if p.instrumented:
        s = read(p, s, motion, stop.t_ns)
    number = s.dead_centre.number + stop.times
    s, charge = charges.at_dead_centre(p, s, stop, number, events)
    s = next_stroke(s, number, -s.stroke.direction, dc_ns, stop.x_m, charge)
    s = moved(p, s, p.engine.turn(motion, s.machine, charge, stop), now_ns, events)
    if p.instrumented:
        s = ended(p, read(p, s, s.motion, stop.t_ns), LEFT if side == RIGHT else RIGHT)
    return expect(p, s, taken, now_ns, stop.lasted_s)


def next_stroke(
    s: PlantState, number: i64, direction: int, dc_ns: i64, x_m: float, charge: Charge
) -> PlantState:
    """Enter a dead centre with what burns, or has burnt, at it."""
    return s.but(
        stroke=Stroke(number, direction, dc_ns, x_m, charge),
        dead_centre=DeadCentre(
            number, dc_ns, x_m, charge.fuel_kg, charge.efficiency, charge.lambda_ratio
        ),
    )


def moved(
    p: PlantParams, s: PlantState, motion: Motion, t_ns: i64, events: list[Event]
) -> PlantState:
    """Put a motion in the place of the one before; say when the piston sets off or rests."""
    before = s.motion
    if motion.moving != before.moving:
        if motion.moving:
            events.append(Event(t_ns, IN_MOTION, "the machine moves the piston from rest"))
        else:
            events.append(Event(t_ns, AT_REST, f"piston at rest at {motion.x_m * 1e3:.3f} mm"))
    stroke = s.stroke
    if motion.heading and motion.heading != stroke.direction:
        stroke = replace(stroke, direction=motion.heading)
    return s.but(motion=motion, stroke=stroke)


def begin_at_once(
    p: PlantParams,
    s: PlantState,
    taken: tuple[Edge, ...],
    t_ns: i64,
    held: Held,
    events: list[Event],
) -> PlantState:
    """Apply the edges that act at the start of the stroke itself, before its combustion."""
    for edge in taken:
        if edge.fraction == 0.0:
            s = apply_due(p, s, Due(0.0, edge.event, edge.begins), t_ns, held, events)
    return s


def expect(
    p: PlantParams, s: PlantState, taken: tuple[Edge, ...], now_ns: i64, lasted_s: float
) -> PlantState:
    """Enter the edges that act later in the stroke that has just begun.

    Parameters: lasted_s : duration of the stroke before, for engines that cannot tell this one's
    """
    if not taken:
        return s
    at_once = p.engine.ignition != BY_SPARK
    later = [edge for edge in taken if edge.fraction > 0.0 or not at_once]
    if not later:
        return s
    begun_ns = s.stroke.start_ns
    duration = p.engine.stroke_s(s.motion, s.machine, now_ns, begun_ns) or lasted_s
    return s.but(disturbances=put(s.disturbances, later, duration))


def put(
    d: disturbances.Disturbances, edges: list[Edge], duration_s: float
) -> disturbances.Disturbances:
    """Enter edges at their part of a stroke."""
    for edge in edges:
        d = disturbances.put(d, Due(edge.fraction * duration_s, edge.event, edge.begins))
    return d


def apply_due(
    p: PlantParams, s: PlantState, due: Due, t_ns: i64, held: Held, events: list[Event]
) -> PlantState:
    """Begin or end a disturbance now; a changed load takes effect through `act`."""
    event = p.events[due.event]
    if event.kind == "sensor-fault" and event.text("signal") in SLOW_SIGNALS:
        known = p.engine.sensed(s.motion, s.machine).of(event.text("signal"))
        held = Held(held.x_m, held.v_m_s, known)
    d = disturbances.apply(p.events, s.disturbances, due, held)
    what = "begins" if due.begins else "ends"
    kind = p.events[due.event].kind
    events.append(Event(t_ns, DISTURBANCE, f"{p.names[due.event]} ({kind}) {what}"))
    return s.but(disturbances=d, machine=obey(p, s.machine.order, d.load_scale))


def take_due(
    p: PlantParams, s: PlantState, t_ns: i64, held: Held, events: list[Event]
) -> PlantState:
    """Apply the disturbance that is due here."""
    d, due = disturbances.pop(s.disturbances)
    s = apply_due(p, s.but(disturbances=d), due, t_ns, held, events)
    if p.events[due.event].kind == PRE_IGNITION:
        s = charges.catch_fire(p, s, due.event, t_ns, events)
    return act(p, s, t_ns, events)


def act(p: PlantParams, s: PlantState, t_ns: i64, events: list[Event]) -> PlantState:
    """Let a changed machine act from here on; a piston that it sets off begins a stroke."""
    motion = p.engine.follow(s.motion, s.machine)
    if motion is s.motion:
        return s
    woken, rested_s = motion.moving and not s.motion.moving, s.motion.tau_s
    s = moved(p, s, motion, t_ns, events)
    if not woken:
        return s
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, t_ns, rested_s)
    stroke = Stroke(s.dead_centre.number, s.stroke.direction, t_ns, s.x_m, NO_CHARGE)
    s = s.but(stroke=stroke, disturbances=d)
    s = begin_at_once(p, s, taken, t_ns, Held(s.x_m, s.v_m_s), events)
    s = moved(p, s, p.engine.follow(s.motion, s.machine), t_ns, events)
    return expect(p, s, taken, t_ns, 0.0)


def read(p: PlantParams, s: PlantState, motion: Motion, t_ns: float) -> PlantState:
    """Take a reading of the pressures."""
    if not p.config.indicator.on:
        return s
    interval_ns = p.config.indicator.interval_s * 1e9
    return s.but(
        instruments=indicator.read(s.instruments, p.engine, motion, s.machine, t_ns, interval_ns)
    )


def ended(p: PlantParams, s: PlantState, side: int) -> PlantState:
    """End the cycle of a cylinder at its bottom dead centre."""
    if not p.config.indicator.on:
        return s
    return s.but(instruments=indicator.ended(s.instruments, p.engine, s.motion, side))
