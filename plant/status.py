"""How the plant is, and how its run went, in the words of a status, a summary, an error."""

from __future__ import annotations

from typing import Any

from hil.errors import PEER_LOST, RunError
from hil.ports import Ports
from hil.wire.latch import RELEASED
from plant.loop import PlantLoop


def is_safe(loop: PlantLoop) -> bool:
    """Whether the plant is in its safe state."""
    return loop.state.latch != RELEASED


def describe(loop: PlantLoop) -> str:
    """How the plant is, in one line."""
    state = loop.state
    how = "safe state" if is_safe(loop) else "controlled"
    return f"{how}, tick {state.tick}, TDC {abs(state.dead_centre.x_m) * 1e3:.2f} mm"


def raise_if_lost(loop: PlantLoop) -> None:
    """A run that ended without its controller did not end well.

    Raises: RunError
    """
    if loop.state.stale >= loop.params.stale_ticks:
        if not loop.answered:
            raise RunError("controller never answered")
        raise RunError(f"controller {PEER_LOST} command in the last {loop.state.stale} ticks")


def facts(loop: PlantLoop, ports: Ports, ticks: int) -> dict[str, Any]:
    """How it went, for the summary."""
    return {
        "ticks": ticks,
        "answered": loop.answered,
        "contacts": loop.state.contacts,
        "reception": loop.decoder.counts()._asdict(),
        "link": dict(ports.link.counters()),
    }
