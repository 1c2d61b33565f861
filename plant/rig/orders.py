"""A tick's orders, whatever solves the motion: machine, pulses, and what silence comes to."""

from __future__ import annotations

from plant.params import PlantParams
from plant.rig import actuation
from plant.rig.actuation import NEVER_NS, Injector, PulseOrder
from plant.rig.events import ORDER_REFUSED, PULSE_REFUSED, SAFE_STATE, SAFE_STATE_LEFT, Event
from plant.rig.machine import MachineOrder, obey, objection, safe_order
from plant.rig.state import Command, PlantState


def follow(
    p: PlantParams, s: PlantState, command: Command | None, events: list[Event]
) -> PlantState:
    """Take a tick's orders, or count the silence when there are none."""
    return _silence(p, s, events) if command is None else _take(p, s, command, events)


def _take(p: PlantParams, s: PlantState, command: Command, events: list[Event]) -> PlantState:
    """Take a valid tick's orders; ordinarily they are the ones in force already."""
    now_ns = s.tick * p.period_ns
    if s.stale:
        if s.stale >= p.stale_ticks:
            events.append(Event(now_ns, SAFE_STATE_LEFT, "commands have returned"))
        s = s._replace(stale=0)
    order = command.machine
    if order is not None and order != s.machine.order:
        s = _reorder(p, s, order, now_ns, events)
    if not command.may_fire:
        return _shut(p, s, now_ns) if s.pulses.next_edge_ns < NEVER_NS else s
    return _take_pulses(s, command.pulses, now_ns, events) if command.pulses else s


def _take_pulses(
    s: PlantState, orders: tuple[PulseOrder, ...], now_ns: int, events: list[Event]
) -> PlantState:
    """Enter the pulses that are new, and tell which were refused."""
    pulses, refused = actuation.receive(s.pulses, orders, now_ns)
    for reason, pulse in refused:
        text = f"{reason}: channel {pulse.channel}, open {pulse.open_us} us"
        events.append(Event(now_ns, PULSE_REFUSED, f"{text}, for {pulse.duration_us} us"))
    return s if pulses is s.pulses else s._replace(pulses=pulses)


def _shut(p: PlantParams, s: PlantState, now_ns: int) -> PlantState:
    """Close the injectors and forget every pulse to come."""
    injector = Injector(p.flow_kg_s, p.dead_time_ns)
    return s._replace(pulses=actuation.shut(s.pulses, injector, now_ns))


def _reorder(
    p: PlantParams, s: PlantState, order: MachineOrder, now_ns: int, events: list[Event]
) -> PlantState:
    """Put a new machine order in force, or refuse it."""
    reason = objection(order)
    if reason:
        events.append(Event(now_ns, ORDER_REFUSED, reason))
        return s
    return s._replace(machine=obey(p, order, s.disturbances.load_scale))


def _silence(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Count the silence; when it has lasted, brake, and close the injectors."""
    s = s._replace(stale=s.stale + 1)
    if s.stale != p.stale_ticks:
        return s
    now_ns = s.tick * p.period_ns
    text = f"no valid command for {s.stale} ticks: injectors closed, ignition off, machine braking"
    events.append(Event(now_ns, SAFE_STATE, text))
    return _reorder(p, _shut(p, s, now_ns), safe_order(p), now_ns, events)
