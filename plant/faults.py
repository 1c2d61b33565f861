"""Faults ordered while the engine runs: the scenario's disturbances, over the command key.

{"kind": "misfire", "count": 2} begins with the first stroke from now on; the fields are those of a
scenario's event, `at_s` left out.
"""

from __future__ import annotations

import json
from typing import Final

from pydantic import TypeAdapter, ValidationError

from hil.config.plant import FAULT_KINDS, PlantEvent
from hil.errors import ConfigError
from hil.values import replace
from plant.memory import Ordered
from plant.rig.disturbances import compile_edges
from plant.rig.params import PlantParams

_EVENT: Final[TypeAdapter[PlantEvent]] = TypeAdapter(PlantEvent)


def parse(raw: bytes, origin: str, t_ns: int) -> PlantEvent | None:
    """Read a fault; None for a command that is not for the plant.

    Raises: ConfigError naming origin, field and what is wrong with it
    """
    try:
        fields = json.loads(raw)
    except (ValueError, RecursionError):
        return None  # the controller reads the same key and says so
    if not isinstance(fields, dict) or fields.get("kind") not in FAULT_KINDS:
        return None
    if "at_s" in fields:
        raise ConfigError(f"command from {origin}: at_s: a fault that is ordered begins at once")
    try:
        return _EVENT.validate_python({**fields, "at_s": t_ns * 1e-9})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"][1:]) or "fault"
        raise ConfigError(f"command from {origin}: {where}: {first['msg']}") from None


def with_fault(p: PlantParams, next_edge: int, event: PlantEvent) -> PlantParams:
    """Return the parameters with one more event; those that have begun keep their place.

    Parameters: next_edge : how many edges of the events have begun
    """
    number = len(p.events)
    new = [replace(edge, event=number) for edge in compile_edges((event,))]
    ahead = sorted((*p.edges[next_edge:], *new), key=lambda e: (e.at_ns, e.begins, e.event))
    return replace(
        p,
        names=(*p.names, f"ordered {number + 1}"),
        events=(*p.events, event),
        edges=(*p.edges[:next_edge], *ahead),
    )


def with_ordered(p: PlantParams, ordered: tuple[Ordered, ...]) -> PlantParams:
    """Return the parameters with the faults that a run had been ordered."""
    for one in ordered:
        event = parse(one.text.encode(), "the log", one.t_ns)
        if event is not None:
            p = with_fault(p, one.next_edge, event)
    return p
