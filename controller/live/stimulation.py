"""Stimuli of the controller: what conditions can see, and what they order in a tick."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, final

from controller.state import Output, State, StrokeReport
from hil.stimuli.player import Player, PlayerMemory
from hil.stimuli.records import packed
from hil.values import Value
from hil.wire.commands import BY_PARAMETER, OperatorCommand, parse, write

Seen = tuple[State, StrokeReport | None]
"""State at the end of the tick before, and the last finished stroke; None before the first."""

_NAN: Final = float("nan")

SIGNALS: Final[dict[str, Callable[[Seen], float]]] = {
    "controller.sensor.x_m": lambda seen: seen[0].motion.x_m,
    "controller.sensor.v_m_s": lambda seen: seen[0].motion.v_m_s,
    "controller.stroke.index": lambda seen: _NAN if seen[1] is None else float(seen[1].number),
    "controller.stroke.tdc_m": lambda seen: _NAN if seen[1] is None else seen[1].tdc_m,
    "controller.stroke.tdc_ref_m": lambda seen: seen[0].set_points.tdc_ref_m,
    "controller.stroke.v_mid_m_s": lambda seen: _NAN if seen[1] is None else seen[1].v_mid_m_s,
    "controller.stroke.fuel_kg": lambda seen: _NAN if seen[1] is None else seen[1].demand.fuel_kg,
}
"""What a condition of the controller may look at: its value at the end of the tick before."""


@final
class StimulationMemory(Value):
    """What the stimuli of the next tick depend on; waiting: commands as the key carries them."""

    __slots__ = ("player", "happened", "waiting", "stroke")

    def __init__(
        self, player: PlayerMemory, happened: tuple[str, ...], waiting: tuple[str, ...],
        stroke: StrokeReport | None,
    ) -> None:  # fmt: skip
        self.player = player
        self.happened = happened
        self.waiting = waiting
        self.stroke = stroke


class Stimulation:
    """The controller's stimuli.

    planned: names of the scenario's own orders by tick
    happened: names and codes of what has happened in the tick before
    told: records of this tick
    """

    def __init__(self, player: Player, planned: dict[int, str]) -> None:
        self.player = player
        self._planned = planned
        self._stroke: StrokeReport | None = None
        self.happened: tuple[str, ...] = ()
        self.told = b""
        self._waiting: deque[OperatorCommand] = deque()

    def take(self, tick: int, t_ns: int, state: State) -> dict[str, float]:
        """Return the parameters that change with this tick; commands wait for `command`.

        A set point is changed as an operator does it: in one command, however many change.
        """
        seen = state, self._stroke
        taken = self.player.take(tick, lambda name: SIGNALS[name](seen), self.happened)
        self.told = packed(taken, self.player.values, tick, t_ns)
        self._waiting.extend(command.command for _, command in taken.commands)
        set_points = {key: v for key, v in taken.changes.items() if key in BY_PARAMETER}
        if set_points:
            fields = {BY_PARAMETER[key][1]: value for key, value in set_points.items()}
            self._waiting.append(OperatorCommand("set-point", fields))
        return {key: v for key, v in taken.changes.items() if key not in set_points}

    def command(self) -> OperatorCommand | None:
        """Return the command that is to be followed now, the oldest first."""
        return self._waiting.popleft() if self._waiting else None

    def note(self, tick: int, output: Output) -> None:
        """Remember what this tick told, and which order was planned for it."""
        codes = tuple(code for code, _ in output.events)
        if output.stroke is not None:
            self._stroke = output.stroke
        planned = self._planned.get(tick)
        self.happened = codes if planned is None else (*codes, planned)

    def remember(self) -> StimulationMemory:
        """Return all that the next tick depends on."""
        waiting = tuple(write(command).decode() for command in self._waiting)
        return StimulationMemory(self.player.memory, self.happened, waiting, self._stroke)

    def recall(self, memory: StimulationMemory) -> dict[str, float]:
        """Go on from what `remember` returned; return the parameters that were in force."""
        self.player.memory = memory.player
        self.happened, self._stroke = memory.happened, memory.stroke
        found = (parse(text.encode(), "scenario") for text in memory.waiting)
        self._waiting = deque(command for command in found if command is not None)
        return {key: v for key, v in self.player.values.items() if key not in BY_PARAMETER}
