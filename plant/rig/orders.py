"""A tick's orders: machine and pulses, what comes late, and what silence comes to."""

from __future__ import annotations

import math
from typing import Final

from hil.values import replace
from hil.wire import pulses
from hil.wire.messages import GENERATOR, MACHINE_MODES, MOTOR
from hil.wire.pulses import PulseOrder
from plant.engines.machine import Machine, MachineOrder, same_order
from plant.rig import actuation, air, silence
from plant.rig.events import ORDER_REFUSED, PULSE_REFUSED, Event
from plant.rig.params import PlantParams
from plant.rig.state import AS_BEFORE, Command, PlantState

_NO_PULSES: Final[tuple[PulseOrder, ...]] = ()


def delayed(
    p: PlantParams, s: PlantState, command: Command | None
) -> tuple[PlantState, Command | None]:
    """Put a command behind those that wait; what came `delay_ticks` ago acts now.

    Before the first one acts, the plant goes on as it began.
    """
    waiting = (*s.waiting, command)
    if len(waiting) <= p.delay_ticks:
        return replace(s, waiting=waiting), AS_BEFORE
    return replace(s, waiting=waiting[1:]), waiting[0]


def follow(
    p: PlantParams, s: PlantState, command: Command | None, events: list[Event]
) -> PlantState:
    """Take a tick's orders, or count the silence when there are none."""
    return _silence(p, s, events) if command is None else _take(p, s, command, events)


def _take(p: PlantParams, s: PlantState, command: Command, events: list[Event]) -> PlantState:
    """Take a valid tick's orders; ordinarily they are the ones in force already."""
    now_ns = s.tick * p.period_ns
    if s.stale or s.latch:
        s = silence.heard(p, s, command, events)
        if s.latch:
            return s
    if 0.0 <= command.throttle != s.manifold.throttle:
        full_pa = s.manifold.full_pa
        s = s.but(manifold=air.moved(s.manifold, command.throttle, full_pa, now_ns))
    order = command.machine
    if order is not None and not same_order(order, s.machine.order):
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
        after = actuation.advance(after, p.injector, float(now_ns), p.valves)
    return s.but(pulses=after)


def _reorder(
    p: PlantParams, s: PlantState, order: MachineOrder, now_ns: int, events: list[Event]
) -> PlantState:
    """Put a new machine order in force, or refuse it."""
    reason = objection(order)
    if reason:
        events.append(Event(now_ns, ORDER_REFUSED, reason))
        return s
    return s.but(machine=obey(p, order, s.disturbances.load_scale))


def _silence(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Count the silence; when it has lasted, brake, and close the injectors.

    A machine that motors brakes at once: a first charge that burns meanwhile would drive the piston
    into the head, since the order to brake has not come.
    """
    s, begins = silence.silent(p, s, events)
    if begins:
        s = _lines(p, s, False, _NO_PULSES, events)
    elif s.machine.order.mode != MOTOR:
        return s
    return _reorder(p, s, silence.safe_order(p), s.tick * p.period_ns, events)


def objection(order: MachineOrder) -> str:
    """Tell what is wrong with an order; an empty string when nothing is."""
    if order.mode not in MACHINE_MODES:
        return f"machine mode {order.mode} is none of 0, 1, 2"
    if not (math.isfinite(order.force_n) and 0.0 <= order.load_coefficient_n_s_m < math.inf):
        return "machine force must be finite, and load coefficient finite and not negative"
    return ""


def obey(p: PlantParams, order: MachineOrder, load_scale: float) -> Machine:
    """Damping c = scale * Ce when generating; force within the peak force when motoring.

    Parameters: load_scale : of the events, beside that of the parameters
    """
    if order.mode == GENERATOR:
        scale = load_scale * p.config.disturbance.load_scale
        return Machine(order, order.load_coefficient_n_s_m * scale, 0.0)
    if order.mode == MOTOR:
        peak = p.peak_force_n
        return Machine(order, 0.0, min(max(order.force_n, -peak), peak))
    return Machine(order, 0.0, 0.0)
