"""The protection in a tick: what it is told, and what it takes back."""

from __future__ import annotations

from mypy_extensions import i64

from controller.mode.start_restart import GENERATING, MOTORING
from controller.observe.estimate import Observation
from controller.state import Inputs, Params, State
from controller.supervision.protection import (
    UNTOUCHED,
    Combustion,
    CycleReport,
    Protection,
)
from controller.supervisory import Events, SetPoints
from hil.wire.messages import CylinderPeak

_NONE: Events = ()


def protected(
    params: Params, state: State, seen: Observation, inputs: Inputs, verdict: i64
) -> tuple[Protection, CycleReport | None, Events]:
    """Hold what a tick has told of pressure, speed and winding against the limits.

    Parameters: state : of this tick's mode, before its dead centre is entered;
    verdict : of the motion on the charge before
    """
    p, told, winding_k = state.protection, inputs.told, inputs.winding_k
    guard, report, events = params.guard, None, _NONE
    if guard.is_on and seen.passed.dead_centre:
        fired, begun_ns = Combustion(), state.motion.dc_t_ns
        if seen.whole:
            fired = Combustion(state.in_force.fuel_kg, seen.motion.tdc_m)
        lasted_s = float(seen.motion.dc_t_ns - begun_ns) * 1e-9 if begun_ns >= 0 else 0.0
        p, events = guard.ended(p, seen.motion.side, fired, verdict, lasted_s)
    if type(told) is CylinderPeak:
        p, report, more = guard.heard(p, told)
        events = (*events, *more)
    if guard.is_on and winding_k == winding_k:  # noqa: PLR0124  # not nan
        p, more = guard.warmed(p, winding_k)
        events = (*events, *more)
    if guard.is_on and not _is_active(state):
        return UNTOUCHED, report, _NONE
    return p, report, events


def derated(params: Params, set_points: SetPoints, p: Protection) -> SetPoints:
    """Let the protection's shares act on load and fuel."""
    guard = params.guard
    if not guard.is_on:
        return set_points
    return params.supervisor.derated(set_points, guard.load_share(p), guard.fuel_share(p))


def _is_active(state: State) -> bool:
    return state.mode is GENERATING or state.mode is MOTORING
