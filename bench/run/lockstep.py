"""Both loops in one thread: the controller answers inside the plant's send."""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from controller.loop import ControllerLoop
from drivers.memory_link import MemoryLink
from hil.ports import Link
from plant.loop import PlantLoop


@final
class Answerer:
    """Gives the controller its turn when a sample has been sent."""

    def __init__(self, loop: ControllerLoop, link: Link) -> None:
        self._loop = loop
        self._link = link

    def turn(self) -> None:
        """Take what was sent, and answer it."""
        self._loop.turn(self._link.receive())


def join(plant_end: Link, controller_end: Link, controller: ControllerLoop) -> None:
    """Let the controller answer inside the plant's send."""
    assert isinstance(plant_end, MemoryLink)
    plant_end.on_send = Answerer(controller, controller_end).turn


def run_ticks(loop: PlantLoop, tick: i64, end: i64) -> i64:
    """Run the plant from one tick up to another; return that tick."""
    while tick < end:
        tick = loop.turn(tick)
    return tick
