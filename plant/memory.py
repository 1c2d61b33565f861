"""What the plant's loop remembers from one turn to the next, as a value."""

from __future__ import annotations

from typing import NamedTuple

from hil.codec import DecoderMemory
from plant.rig.state import PlantState
from plant.sensors import Sample


class Measured(NamedTuple):
    """One tick's sensors in SI, and the same as frames."""

    sample: Sample
    p_left_pa: float
    p_right_pa: float
    electric_power_w: float
    batch: bytes


class Ordered(NamedTuple):
    """A fault ordered while the engine ran: as it came, when, and how many edges were past."""

    text: str
    t_ns: int
    next_edge: int


class LoopMemory(NamedTuple):
    """The state of the engine, and of what is around it: codec, answers, silence, faults."""

    state: PlantState
    sent: tuple[int, ...]
    received: DecoderMemory
    first_tick: int
    used_tick: int
    answered: int
    answered_before: bool
    peer_lost: bool
    silent_turns: int
    throttle: float
    measured: Measured
    ordered: tuple[Ordered, ...]
