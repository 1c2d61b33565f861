"""What the controller's loop remembers from one turn to the next, as a value."""

from __future__ import annotations

from typing import NamedTuple

from controller.plausibility import Credence
from controller.state import State
from hil.wire.codec import DecoderMemory
from hil.wire.messages import PistonSample


class LoopMemory(NamedTuple):
    """The state of the layers, and of what is around them: codec, last sample, silence."""

    tick: int
    state: State
    sent: tuple[int, ...]
    received: DecoderMemory
    last_sample: PistonSample
    slow: tuple[float, ...]
    power_w: float
    late: int
    silent_turns: int
    credence: Credence
    doubted: tuple[int, int]
