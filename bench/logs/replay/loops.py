"""Both loops behind one interface for a replay: take a turn, give back its records."""

from __future__ import annotations

from typing import final

import controller.build
import plant.build
import plant.memory
from bench.logs.replay.ports import Catch, Tape, TapeCommands, TapeLink, Unseen
from bench.logs.replay.turn import Turn
from controller.loop import ControllerLoop, LoopMemory
from drivers.links import Connection
from hil import snapshot
from hil.config.resolved import Resolved
from plant.loop import PlantLoop


def _nothing() -> None:
    """Close nothing."""


def _connection(tape: Tape) -> Connection:
    """The ports that a tape plays."""
    return Connection(TapeLink(tape), TapeCommands(tape), Unseen(), _nothing)


class Replayed:
    """A loop that is being replayed, and the ports that play to it."""

    def __init__(self, period_ns: int, patience_ns: int) -> None:
        self.tape, self.catch = Tape(period_ns, patience_ns), Catch()

    def next_tick(self) -> int:
        """The tick that its next turn begins with; -1 when any will do."""
        raise NotImplementedError

    def turn(self, turn: Turn) -> bytes:
        """Run one recorded turn; return the records that it puts today."""
        raise NotImplementedError

    def resume(self, state: str) -> None:
        """Go on from a snapshot."""
        raise NotImplementedError


@final
class ReplayedController(Replayed):
    """The controller's own loop on recorded batches."""

    def __init__(self, scenario: Resolved) -> None:
        patience_ns = controller.build.patience_ns(scenario)
        super().__init__(scenario.loop.period_ns, patience_ns)
        self.loop: ControllerLoop = controller.build.make_loop(
            scenario, _connection(self.tape), self.catch, self.tape
        )

    def next_tick(self) -> int:
        """The tick after the last; before the first the plant decides."""
        return self.loop.tick + 1 if self.loop.tick >= 0 else -1

    def turn(self, turn: Turn) -> bytes:
        """Run one recorded turn; return the records that it puts today."""
        self.tape.load(turn)
        self.loop.turn(turn.batches[0] if turn.batches else None)
        return self.catch.taken()

    def resume(self, state: str) -> None:
        """Go on from a snapshot."""
        self.loop.recall(snapshot.loads(LoopMemory, state))


@final
class ReplayedPlant(Replayed):
    """The plant's own loop on recorded answers."""

    def __init__(self, scenario: Resolved) -> None:
        patience_ns = plant.build.patience_ns(scenario)
        super().__init__(scenario.loop.period_ns, patience_ns)
        self.loop: PlantLoop = plant.build.make_loop(
            scenario, _connection(self.tape), self.catch, self.tape
        )

    def next_tick(self) -> int:
        """The tick at whose start the engine stands."""
        return self.loop.state.tick

    def turn(self, turn: Turn) -> bytes:
        """Run one recorded turn; return the records that it puts today."""
        self.tape.load(turn)
        self.tape.load_slot(turn)
        self.loop.turn(turn.first_tick)
        return self.catch.taken()

    def resume(self, state: str) -> None:
        """Go on from a snapshot."""
        self.loop.recall(snapshot.loads(plant.memory.LoopMemory, state))


LOOPS: dict[str, type[ReplayedController | ReplayedPlant]] = {
    "controller": ReplayedController,
    "plant": ReplayedPlant,
}
