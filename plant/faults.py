"""Faults ordered while the engine runs: the scenario's disturbances, over the command key.

{"kind": "misfire", "count": 2} begins with the first stroke from now on.
"""

from __future__ import annotations

from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from hil.values import replace
from hil.wire import commands
from hil.wire.commands import TimedCommand
from plant.memory import Ordered
from plant.rig.disturbances import compile_edges, objection_to
from plant.rig.params import PlantParams


def parse(raw: bytes, origin: str, t_ns: int, config: PlantConfig) -> TimedCommand | None:
    """Read a fault of this plant; None for a command that is not for the plant.

    Raises: ConfigError naming origin, field and what is wrong with it
    """
    command = commands.parse(raw, origin, commands.PLANT)
    if command is None:
        return None
    if reason := objection_to(config, command.kind):
        raise ConfigError(f"command from {origin}: {reason}")
    try:
        return commands.begun_at(t_ns * 1e-9, command)
    except ValueError as error:
        raise ConfigError(f"command from {origin}: {error}") from None


def with_fault(p: PlantParams, next_edge: int, event: TimedCommand, name: str = "") -> PlantParams:
    """Return the parameters with one more event; those that have begun keep their place.

    Parameters: next_edge : how many edges of the events have begun; name : its own, if it has one
    """
    number = len(p.events)
    new = [replace(edge, event=number) for edge in compile_edges((event,))]
    ahead = sorted((*p.edges[next_edge:], *new), key=lambda e: (e.at_ns, e.begins, e.event))
    return replace(
        p,
        names=(*p.names, name or f"ordered {number + 1}"),
        events=(*p.events, event),
        edges=(*p.edges[:next_edge], *ahead),
    )


def with_ordered(p: PlantParams, ordered: tuple[Ordered, ...]) -> PlantParams:
    """Return the parameters with the faults that a run had been ordered."""
    for one in ordered:
        event = parse(one.text.encode(), "the log", one.t_ns, p.config)
        if event is not None:
            p = with_fault(p, one.next_edge, event, one.name)
    return p
