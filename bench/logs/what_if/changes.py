"""Which parameters of a running engine may be changed, and how each change takes effect."""

from __future__ import annotations

from typing import Any, NamedTuple

import plant.build
from hil.config.check import check
from hil.config.load import with_override
from hil.config.resolved import Resolved
from hil.errors import ConfigError
from hil.names.parameters import parameters
from hil.nearest import did_you_mean, listed
from hil.toml import parse_assignment
from hil.wire.commands import BY_PARAMETER
from plant.rig.params import PlantParams
from plant.rig.state import PlantState

_SETTLED = ("controller.running", "controller.preset", "plant.prototype")
_ACCEPTED = ("controller.", "plant.", "events.", "run.duration_s", "run.seed")


class Changed(NamedTuple):
    """The configuration to go on with; `told` is what the logs say of the changes.

    live: parameters that change at the tick from which the run is continued, as an operator's do
    """

    scenario: Resolved
    plant_params: PlantParams
    told: dict[str, str]
    live: dict[str, object]
    notes: tuple[str, ...]


def changed(
    scenario: Resolved,
    assignments: tuple[str, ...],
    duration_s: float | None,
    tick: int,
    state: PlantState,
) -> Changed:
    """Apply the changes to the configuration of a run that has reached a tick.

    Raises: ConfigError for a change that cannot take effect from there on
    """
    tree: dict[str, Any] = scenario.model_dump()
    tree["loop"]["clock"], tree["link"]["kind"] = "lockstep", "memory"
    told: dict[str, str] = {}
    live: dict[str, object] = {}
    for text in assignments:
        key, value = parse_assignment(text)
        _check(key, scenario)
        told[key] = str(value)
        if key in BY_PARAMETER:
            _add_command(tree, key, value, tick * scenario.loop.period_ns * 1e-9)
        elif key in parameters() and parameters()[key].live:
            live[key] = parameters()[key].checked(value)
        else:
            tree = with_override(tree, key, value)
    if duration_s is not None:
        tree = with_override(tree, "run.duration_s", duration_s)
    new = check(Resolved, tree, "--set")
    params = plant.build.make_params(new)
    _check_events(plant.build.make_params(scenario), params, state)
    if new.ticks <= tick:
        ends = new.run.duration_s
        raise ConfigError(f"run.duration_s = {ends:g}: the run ends before it is continued")
    return Changed(new, params, told, live, _notes(told))


def _check(key: str, scenario: Resolved) -> None:
    """Refuse what acts at the beginning of a run only, or is no parameter of the engine.

    Raises: ConfigError
    """
    if key in BY_PARAMETER:
        return
    begins = next((k for k in _SETTLED if key == k or key.startswith(f"{k}.")), None)
    if begins is not None:
        commands = ", ".join(BY_PARAMETER)
        raise ConfigError(
            f"--set {key}: acts at the start of a run only; while it runs these do: {commands}"
        )
    if not key.startswith(_ACCEPTED):
        hint = did_you_mean(key, parameters())
        raise ConfigError(f"--set {key}: accepted in a what-if are {', '.join(_ACCEPTED)}{hint}")
    if key.startswith("events."):
        name = key.split(".")[1]
        if name not in scenario.events:
            known = listed(name, scenario.events)
            raise ConfigError(f"--set {key}: this run has no events.{name}; it has: {known}")


def _add_command(tree: dict[str, Any], key: str, value: Any, at_s: float) -> None:  # noqa: ANN401
    """Put a change in as the operator's command at the tick from which the run is continued."""
    kind, field = BY_PARAMETER[key]
    name = f"what-if {key}"
    tree["events"] = {**tree["events"], name: {"kind": kind, "at_s": at_s, field: value}}


def _check_events(old: PlantParams, new: PlantParams, state: PlantState) -> None:
    """A disturbance whose stroke has come cannot be changed any more.

    Raises: ConfigError naming the event
    """
    taken = state.disturbances.next_edge
    for before, after in zip(old.edges[:taken], new.edges[:taken], strict=True):
        if before != after or old.events[before.event] != new.events[after.event]:
            name = old.names[before.event]
            raise ConfigError(
                f"--set events.{name}: it has begun by then; accepted are events still to come"
            )
    for edge in new.edges[taken:]:
        if edge.at_ns <= state.stroke.start_ns and state.moving:
            raise ConfigError(
                f"--set events.{new.names[edge.event]}: lies before the continuation, at "
                f"{state.stroke.start_ns * 1e-9:.4f} s"
            )


def _notes(told: dict[str, str]) -> tuple[str, ...]:
    plants = [key for key in told if key.startswith("plant.")]
    if not plants:
        return ()
    return (f"{', '.join(plants)}: acts on the motion from the next dead centre on",)
