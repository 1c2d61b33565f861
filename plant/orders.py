"""A tick's orders, whatever solves the motion: machine, pulses, and what silence comes to."""

from __future__ import annotations

from hil.wire import pulses
from hil.wire.pulses import PulseOrder
from plant import actuation
from plant.actuation import Injector
from plant.events import ORDER_REFUSED, PULSE_REFUSED, SAFE_STATE, SAFE_STATE_LEFT, Event
from plant.machine import MachineOrder, obey, objection, safe_order
from plant.params import PlantParams
from plant.state import Command, PlantState


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
    if command.may_fire and not command.pulses:
        return s
    return _lines(p, s, command.may_fire, command.pulses, events)


def _lines(
    p: PlantParams, s: PlantState, fires: bool, ordered: tuple[PulseOrder, ...],
    events: list[Event],
) -> PlantState:  # fmt: skip
    """Let the lines follow what was ordered of them, and tell which pulses were refused."""
    now_ns = s.tick * p.period_ns
    table, refused = pulses.follow(s.pulses.table, fires, ordered, now_ns)
    if table is s.pulses.table:
        return s
    for reason, pulse in refused:
        text = f"{reason}: channel {pulse.channel}, open {pulse.open_us} us"
        events.append(Event(now_ns, PULSE_REFUSED, f"{text}, for {pulse.duration_us} us"))
    after = actuation.with_table(s.pulses, table)
    if not fires:
        after = actuation.advance(after, Injector(p.flow_kg_s, p.dead_time_ns), now_ns)
    return s._replace(pulses=after)


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
    return _reorder(p, _lines(p, s, False, (), events), safe_order(p), now_ns, events)
