"""Stimuli of the plant: what its conditions can see, and how what they order is put in force."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from hil.config.base import with_leaves
from hil.stimuli.player import Player, PlayerMemory
from hil.stimuli.records import packed
from hil.wire.commands import write
from plant.faults import with_ordered
from plant.log import pack_events
from plant.memory import Ordered
from plant.rig.events import DISTURBANCE, Event
from plant.rig.params import PlantParams
from plant.rig.state import PlantState
from plant.sensors import sample, sensed
from plant.tuning import enforced, retuned

SIGNALS: Final[dict[str, Callable[[PlantParams, PlantState], float]]] = {
    "plant.truth.x_m": lambda p, s: s.motion.x_m,
    "plant.truth.v_m_s": lambda p, s: s.motion.v_m_s,
    "plant.truth.fuel_kg": lambda p, s: s.dead_centre.fuel_kg,
    "plant.truth.load_coefficient_n_s_m": lambda p, s: s.machine.load_coefficient_n_s_m,
    "plant.truth.dc_index": lambda p, s: float(s.dead_centre.number),
    "plant.truth.dc_x_m": lambda p, s: s.dead_centre.x_m,
    "plant.truth.contacts": lambda p, s: float(s.contacts),
    "plant.sensor.x_m": lambda p, s: sample(p, s).x_m,
    "plant.sensor.v_m_s": lambda p, s: sample(p, s).v_m_s,
    "plant.sensor.p_left_pa": lambda p, s: sensed(p, s).p_left_pa,
    "plant.sensor.p_right_pa": lambda p, s: sensed(p, s).p_right_pa,
    "plant.sensor.electric_power_w": lambda p, s: sensed(p, s).electric_power_w,
}
"""What a condition of the plant may look at: its value at the start of a tick."""


class Stimulation:
    """The plant's stimuli; `params`, `state`, `ordered` and `told` are what they come to in a tick.

    ordered: events that began, so that a snapshot has them; told: records of the tick
    """

    def __init__(self, player: Player | None) -> None:
        self._player = player
        self.ordered: tuple[Ordered, ...] = ()
        self.told = b""

    def apply(
        self, p: PlantParams, s: PlantState, happened: tuple[Event, ...]
    ) -> tuple[PlantParams, PlantState]:
        """Put in force what changes with the tick that comes next; return parameters and state.

        Parameters: happened : in the tick before
        """
        player = self._player
        if player is None:
            return p, s
        taken = player.take(
            s.tick, lambda name: SIGNALS[name](p, s), {n for e in happened for n in _names(e)}
        )
        t_ns, events = s.tick * p.period_ns, list[Event]()
        self.told = packed(taken, player.values, s.tick, t_ns)
        if taken.changes:
            p = _retuned(p, taken.changes)
            s = enforced(p, s, events)
        for name, command in taken.commands:
            ordered = Ordered(write(command.command).decode(), t_ns, s.disturbances.next_edge, name)
            self.ordered += (ordered,)
            p = with_ordered(p, (ordered,))
        self.told += pack_events(s.tick, t_ns, tuple(events))
        return p, s

    def remember(self) -> PlayerMemory | None:
        """Return all that the next tick depends on; None without stimuli."""
        return None if self._player is None else self._player.memory

    def recall(self, memory: PlayerMemory | None, p: PlantParams) -> PlantParams:
        """Go on from what `remember` returned; return the parameters that were in force."""
        if self._player is None or memory is None:
            return p
        self._player.memory = memory
        return _retuned(p, self._player.values)


def _retuned(p: PlantParams, changes: dict[str, float]) -> PlantParams:
    own = {key.removeprefix("plant."): value for key, value in changes.items()}
    return retuned(p, with_leaves(p.config, own))


def _names(event: Event) -> tuple[str, ...]:
    """The code of an event, and the name of the scenario's event that it tells the beginning of."""
    if event.code == DISTURBANCE and event.text.endswith(" begins"):
        return event.code, event.text.partition(" ")[0]
    return (event.code,)
