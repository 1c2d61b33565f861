"""One tick of the plant: orders taken, motion solved, every instant inside it honoured.

step(params, state, command) -> (state, events). An ordinary tick is one evaluation of a closed
form; a tick with an edge, a dead centre or a contact inside goes through `_busy_tick`.
"""

from __future__ import annotations

from plant.engines.fast.linear import DEAD_CENTRE, NO_STOP, UNDERDAMPED, Segment, evaluate
from plant.engines.fast.paths import acceleration, advance
from plant.params import PlantParams
from plant.rig import actuation, disturbances, orders
from plant.rig.actuation import Injector
from plant.rig.disturbances import Held
from plant.rig.events import Event
from plant.rig.state import Command, PlantState
from plant.rig.stroke import REST_M, REST_M_S, apply_due, come_to_rest, end_stroke, repath

# Bounces against a head shrink without end; after this many stops in a tick the piston rests.
_MAX_STOPS = 32

Events = tuple[Event, ...]


def step(p: PlantParams, s: PlantState, command: Command | None) -> tuple[PlantState, Events]:
    """Integrate exactly one tick with the command now in force.

    Parameters: command : Command, or None for a tick without a valid one
    Returns: the state at the start of the next tick, and what happened in this one, in order
    """
    events: list[Event] = []
    if p.delay_ticks:
        s, command = _delayed(p, s, command)
    if p.detailed is not None:
        return p.detailed.step(p, s, command)
    machine = s.machine
    s = orders.follow(p, s, command, events)
    if s.machine is not machine and s.machine[1:] != machine[1:]:
        s = repath(p, s, s.tick * p.period_ns, events)
    end_ns = (s.tick + 1) * p.period_ns
    tau = s.tau_s + p.dt_s
    if tau < s.disturbances.due_s and s.pulses.next_edge_ns > end_ns:
        plain = _plain_tick(p, s, tau)
        if plain is not None:
            return plain, tuple(events)
    s = _busy_tick(p, s, events)
    return s, tuple(events)


def _delayed(
    p: PlantParams, s: PlantState, command: Command | None
) -> tuple[PlantState, Command | None]:
    """Put a command behind those that wait; what came `delay_ticks` ago acts now.

    Before the first one acts, the plant goes on as it began.
    """
    waiting = (*s.waiting, command)
    if len(waiting) <= p.delay_ticks:
        return s._replace(waiting=waiting), Command()
    return s._replace(waiting=waiting[1:]), waiting[0]


def _plain_tick(p: PlantParams, s: PlantState, tau: float) -> PlantState | None:
    """Move through a tick in which nothing happens; None when something does."""
    (tick, x, v, _, moving, path, stroke, machine, pulses, d, dc, stale, contacts, waiting, _) = s
    if moving:
        if not isinstance(path, Segment) or path.regime != UNDERDAMPED:
            return None
        x, v = evaluate(path, tau)
        direction = stroke.direction
        if v * direction <= 0.0 or x * direction >= p.engine.contact_m:
            return None
    return PlantState(
        tick + 1, x, v, tau, moving, path, stroke, machine, pulses, d, dc, stale, contacts, waiting
    )


def _busy_tick(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Move through a tick from one instant of note to the next."""
    held = Held(s.x_m, s.v_m_s)
    start_ns = s.tick * p.period_ns
    used = 0.0
    for _ in range(_MAX_STOPS):
        left = p.dt_s - used
        wait = max(s.disturbances.due_s - s.tau_s, 0.0)
        span = min(left, wait)
        s, spent, stop = _move(p, s, span)
        used = p.dt_s if stop == NO_STOP and span == left else used + spent
        if stop != NO_STOP:
            s = end_stroke(p, s, start_ns + used * 1e9, stop, held=held, events=events)
        elif wait <= left:
            s = _take_due(p, s, round(start_ns + used * 1e9), held, events)
        if used >= p.dt_s:
            break
    else:
        s = come_to_rest(s._replace(tau_s=s.tau_s + p.dt_s - used), start_ns, events)
    return _finish_tick(p, s, events)


def _move(p: PlantParams, s: PlantState, span: float) -> tuple[PlantState, float, int]:
    """Move on by `span` seconds, or to the end of the stroke if that comes first."""
    if not s.moving:
        return s._replace(tau_s=s.tau_s + span), span, NO_STOP
    x, v, spent, stop = advance(
        s.path,
        s.x_m,
        s.v_m_s,
        s.tau_s,
        span,
        direction=s.stroke.direction,
        contact_m=p.engine.contact_m,
    )
    return s._replace(x_m=x, v_m_s=v, tau_s=s.tau_s + spent), spent, stop


def _take_due(
    p: PlantParams, s: PlantState, t_ns: int, held: Held, events: list[Event]
) -> PlantState:
    """Apply the disturbance edge that is due here."""
    d, due = disturbances.pop(s.disturbances)
    s = s._replace(disturbances=d)
    return repath(p, apply_due(p, s, due, t_ns=t_ns, held=held, events=events), t_ns, events)


def _finish_tick(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Apply the pulse edges up to the tick's end, and see whether a creeping piston has stopped."""
    end_ns = (s.tick + 1) * p.period_ns
    injector = Injector(p.flow_kg_s, p.dead_time_ns)
    if _creeps_no_more(p, s):
        if s.stroke.energy_j == 0.0:
            s = come_to_rest(s, end_ns, events)
        else:
            s = end_stroke(p, s, end_ns, DEAD_CENTRE, held=Held(s.x_m, 0.0), events=events)
    return s._replace(tick=s.tick + 1, pulses=actuation.advance(s.pulses, injector, end_ns))


def _creeps_no_more(p: PlantParams, s: PlantState) -> bool:
    """Tell whether a motion too damped to have a dead centre has come to its end."""
    if not s.moving or abs(s.v_m_s) > REST_M_S:
        return False
    if isinstance(s.path, Segment) and s.path.regime == UNDERDAMPED:
        return False
    inertia = p.engine.mass_kg * abs(acceleration(s.path, s.x_m, s.v_m_s, s.tau_s))
    damping = s.machine.load_coefficient_n_s_m * abs(s.v_m_s)
    return inertia + damping <= p.engine.rest_stiffness_n_m * REST_M
