"""What an operator asks for: set points and law, taken or refused with the reason."""

from __future__ import annotations

from controller.motion.choice import refusal
from controller.observe.estimate import NOTHING
from controller.state import Params, State, view_of
from controller.supervisory import Events
from hil.values import replace
from hil.wire.commands import OperatorCommand


def obey(params: Params, state: State, command: OperatorCommand) -> tuple[State, Events]:
    """Take an operator's command; start and stop are facts for the mode table."""
    reason = _refusal(params, command)
    if reason:
        return state, (("command-refused", reason),)
    told: Events = ()
    if command.kind == "set-point":
        set_points, told = params.supervisor.changed(
            state.set_points, command.number("tdc_ref_m"), command.number("target_power_w")
        )
        state = replace(state, set_points=set_points)
    law = command.text("law")
    if law is not None:
        state = _with_law(params, state, law)
    return state, (("command", command.describe()), *told)


def _refusal(params: Params, command: OperatorCommand) -> str:
    """Why a command cannot be taken; an empty string when it can."""
    tdc_m, law = command.number("tdc_ref_m"), command.text("law")
    most_m = params.bounds.limit_m - params.config.supervisory.tdc_room_m
    if tdc_m is not None and tdc_m > most_m:
        return f"tdc_ref_m={tdc_m:g} from {command.origin}: accepted up to {most_m:g}"
    reason = "" if law is None else refusal(law, params.laws, params.stroke_map)
    return f"{reason} (from {command.origin})" if reason else ""


def _with_law(params: Params, state: State, name: str) -> State:
    """Let another law go on from here; in a mode without one it will begin afresh."""
    view = view_of(params, state.motion, NOTHING, state.set_points, state.fuelling, float("nan"))
    return replace(state, fuelling=state.fuelling.handed_over(name, params.law_of(name), view))
