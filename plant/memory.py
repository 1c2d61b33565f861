"""What the plant's loop remembers from one turn to the next, as a value."""

from __future__ import annotations

from typing import final

from hil.names.changes import ChangesMemory
from hil.stimuli.player import PlayerMemory
from hil.values import Value
from plant.answers import AnswersMemory
from plant.rig.state import PlantState


@final
class Measured(Value):
    """One tick's sensors in SI, and the same as frames."""

    __slots__ = ("x_m", "v_m_s", "p_left_pa", "p_right_pa", "electric_power_w", "batch")

    def __init__(
        self,
        x_m: float,
        v_m_s: float,
        p_left_pa: float,
        p_right_pa: float,
        electric_power_w: float,
        batch: bytes,
    ) -> None:
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.p_left_pa = p_left_pa
        self.p_right_pa = p_right_pa
        self.electric_power_w = electric_power_w
        self.batch = batch


@final
class Ordered(Value):
    """A fault ordered while the engine ran: as it came, when, and how many edges were past.

    name: of the scenario's event that it is, empty when it came over the command key
    """

    __slots__ = ("text", "t_ns", "next_edge", "name")

    def __init__(self, text: str, t_ns: int, next_edge: int, name: str = "") -> None:
        self.text = text
        self.t_ns = t_ns
        self.next_edge = next_edge
        self.name = name


@final
class LoopMemory(Value):
    """The state of the engine, and of what is around it: frames, answers, faults, changes, stimuli.

    told: records of the stimuli that the next tick begins with
    """

    __slots__ = (
        "state", "sent", "answers", "measured", "ordered", "changes", "stimuli", "told",
    )  # fmt: skip

    def __init__(
        self,
        state: PlantState,
        sent: tuple[int, ...],
        answers: AnswersMemory,
        measured: Measured,
        ordered: tuple[Ordered, ...],
        changes: ChangesMemory,
        stimuli: PlayerMemory | None = None,
        told: bytes = b"",
    ) -> None:
        self.state = state
        self.sent = sent
        self.answers = answers
        self.measured = measured
        self.ordered = ordered
        self.changes = changes
        self.stimuli = stimuli
        self.told = told
