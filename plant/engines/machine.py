"""The linear machine: what it is asked to do, and the damping and force that come of it."""

from __future__ import annotations

from typing import Final, final

from hil.values import Value
from hil.wire.messages import OFF


@final
class MachineOrder(Value):
    """What the machine is asked to do; force counts in mode motor, the load in generator."""

    __slots__ = ("mode", "force_n", "load_coefficient_n_s_m")

    def __init__(self, mode: int, force_n: float, load_coefficient_n_s_m: float) -> None:
        self.mode = mode
        self.force_n = force_n
        self.load_coefficient_n_s_m = load_coefficient_n_s_m


@final
class Machine(Value):
    """What the machine does: the order and the damping and force in force (thesis eq. 5.5)."""

    __slots__ = ("order", "load_coefficient_n_s_m", "force_n")

    def __init__(self, order: MachineOrder, load_coefficient_n_s_m: float, force_n: float) -> None:
        self.order = order
        self.load_coefficient_n_s_m = load_coefficient_n_s_m
        self.force_n = force_n


def same_order(a: MachineOrder, b: MachineOrder) -> bool:
    """Whether two orders ask for the same."""
    return a is b or (
        a.mode == b.mode
        and a.force_n == b.force_n
        and a.load_coefficient_n_s_m == b.load_coefficient_n_s_m
    )


IDLE: Final = Machine(MachineOrder(OFF, 0.0, 0.0), 0.0, 0.0)
