"""Silence: counted by the tick, then the safe state, out of which leads only a start."""

from __future__ import annotations

from typing import Final

from hil.values import replace
from hil.wire import latch
from hil.wire.messages import GENERATOR, UNHEARD_SAFE
from plant.engines.machine import MachineOrder
from plant.rig.events import SAFE_STATE, SAFE_STATE_LEFT, Event
from plant.rig.params import PlantParams
from plant.rig.state import Command, PlantState

_REARMED: Final = "commands have returned, and safety.rearm needs no start"
_STARTED: Final = "the controller was at rest and has been started"


def unheard(p: PlantParams, s: PlantState) -> int:
    """How long the controller has not been heard, as its frames tell it: 15 is the safe state.

    Of the time that is borne, in fourteenths, rounded up.
    """
    if s.latch != latch.RELEASED:
        return UNHEARD_SAFE
    return 0 if s.stale == 0 else min(-(-s.stale * (UNHEARD_SAFE - 1) // p.stale_ticks), 14)


def heard(p: PlantParams, s: PlantState, command: Command, events: list[Event]) -> PlantState:
    """End the silence; a latch opens as the answers allow."""
    if s.latch == latch.RELEASED:
        return replace(s, stale=0) if s.stale else s
    if command.machine is None:
        return replace(s, stale=0)
    after = latch.RELEASED if p.rearm else latch.after_answer(s.latch, command.may_fire)
    if after == latch.RELEASED:
        text = _REARMED if p.rearm else _STARTED
        events.append(Event(s.tick * p.period_ns, SAFE_STATE_LEFT, text))
    return replace(s, stale=0, latch=after)


def silent(p: PlantParams, s: PlantState, events: list[Event]) -> tuple[PlantState, bool]:
    """Count a tick without an answer; returns also whether the safe state begins with it."""
    s = replace(s, stale=s.stale + 1)
    if s.stale < p.stale_ticks or s.latch == latch.LATCHED:
        return s, False
    if s.latch == latch.AT_REST:
        return replace(s, latch=latch.LATCHED), False
    silent_ms = float(s.stale * p.period_ns) * 1e-6
    text = f"no valid command for {silent_ms:g} ms: injectors closed, ignition off, machine braking"
    events.append(Event(s.tick * p.period_ns, SAFE_STATE, text))
    return replace(s, latch=latch.LATCHED), True


def safe_order(p: PlantParams) -> MachineOrder:
    """Brake as a generator at the full nominal load coefficient."""
    return MachineOrder(GENERATOR, 0.0, p.load_coefficient_n_s_m)
