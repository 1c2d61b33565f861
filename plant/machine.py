"""The linear machine: what an order makes of damping and force (thesis eq. 5.5)."""

from __future__ import annotations

import math
from typing import NamedTuple

from hil.messages import GENERATOR, MACHINE_MODES, MOTOR, OFF
from plant.params import PlantParams


class MachineOrder(NamedTuple):
    """What the machine is asked to do; force counts in mode motor, the load in generator."""

    mode: int
    force_n: float
    load_coefficient_n_s_m: float


class Machine(NamedTuple):
    """What the machine does: the order and the damping and force in force."""

    order: MachineOrder
    load_coefficient_n_s_m: float
    force_n: float


OFF_ORDER = MachineOrder(OFF, 0.0, 0.0)
IDLE = Machine(OFF_ORDER, 0.0, 0.0)


def safe_order(params: PlantParams) -> MachineOrder:
    """Brake as a generator at the full nominal load coefficient."""
    return MachineOrder(GENERATOR, 0.0, params.load_coefficient_n_s_m)


def objection(order: MachineOrder) -> str:
    """Tell what is wrong with an order; an empty string when nothing is."""
    if order.mode not in MACHINE_MODES:
        return f"machine mode {order.mode} is none of {', '.join(map(str, MACHINE_MODES))}"
    if not (math.isfinite(order.force_n) and 0.0 <= order.load_coefficient_n_s_m < math.inf):
        return "machine force must be finite, and load coefficient finite and not negative"
    return ""


def obey(params: PlantParams, order: MachineOrder, load_scale: float) -> Machine:
    """Damping c = scale * Ce when generating; force within the peak force when motoring."""
    if order.mode == GENERATOR:
        return Machine(order, order.load_coefficient_n_s_m * load_scale, 0.0)
    if order.mode == MOTOR:
        peak = params.peak_force_n
        return Machine(order, 0.0, min(max(order.force_n, -peak), peak))
    return Machine(order, 0.0, 0.0)
