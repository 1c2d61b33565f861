"""The plant's whole state as a value: copy it, compare it, step it again."""

from __future__ import annotations

from typing import NamedTuple

from plant.engines.detailed.types import GasState
from plant.engines.fast.combustion import Stroke
from plant.engines.fast.paths import Path
from plant.rig.actuation import PulseOrder, PulseTable
from plant.rig.disturbances import Disturbances
from plant.rig.machine import Machine, MachineOrder


class Command(NamedTuple):
    """What one tick's valid frames said; `may_fire` false forces all TTL lines low."""

    machine: MachineOrder | None = None
    pulses: tuple[PulseOrder, ...] = ()
    may_fire: bool = True


class DeadCentre(NamedTuple):
    """The last dead centre exactly; number 0 means that there was none yet.

    `fuel_kg` is what burnt there, nought after a misfire.
    """

    number: int
    t_ns: int
    x_m: float
    fuel_kg: float
    efficiency: float


class PlantState(NamedTuple):
    """The truth at the start of a tick; `tau_s` counts from the start of the stroke.

    waiting: commands that have arrived and do not act yet, the oldest first
    """

    tick: int
    x_m: float
    v_m_s: float
    tau_s: float
    moving: bool
    path: Path
    stroke: Stroke
    machine: Machine
    pulses: PulseTable
    disturbances: Disturbances
    dead_centre: DeadCentre
    stale: int
    contacts: int
    waiting: tuple[Command | None, ...] = ()
    gas: GasState | None = None


def truth(state: PlantState) -> tuple[float, ...]:
    """What the log holds of a state: the fields of /truth after its tick and instant."""
    number, dc_t_ns, dc_x_m, fuel_kg, _ = state.dead_centre
    return (
        state.x_m, state.v_m_s, fuel_kg, state.machine.load_coefficient_n_s_m,
        state.disturbances.mask, number, dc_t_ns, dc_x_m, state.contacts,
    )  # fmt: skip
