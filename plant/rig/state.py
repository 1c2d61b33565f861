"""The plant's whole state as a value: copy it, compare it, step it again."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64, mypyc_attr

from hil.values import Value
from hil.wire.pulses import PulseOrder
from plant.engines.machine import Machine, MachineOrder
from plant.engines.protocol import Charge, Motion
from plant.rig.actuation import Actuation
from plant.rig.air import Manifold
from plant.rig.disturbances import Disturbances
from plant.rig.indicator import UNUSED, Instruments


@final
class Command(Value):
    """What one tick's valid frames said; `may_fire` false forces all TTL lines low.

    throttle: opening, below nought when nothing is said of it
    """

    __slots__ = ("machine", "pulses", "may_fire", "throttle")

    def __init__(
        self,
        machine: MachineOrder | None = None,
        pulses: tuple[PulseOrder, ...] = (),
        may_fire: bool = True,
        throttle: float = -1.0,
    ) -> None:
        self.machine = machine
        self.pulses = pulses
        self.may_fire = may_fire
        self.throttle = throttle


AS_BEFORE: Final = Command()
"""An answer that orders nothing new."""


@final
class Stroke(Value):
    """The stroke under way; `number` counts dead centres."""

    __slots__ = ("number", "direction", "start_ns", "start_x_m", "charge")

    def __init__(
        self, number: int, direction: int, start_ns: int, start_x_m: float, charge: Charge
    ) -> None:
        self.number = number
        self.direction = direction
        self.start_ns = start_ns
        self.start_x_m = start_x_m
        self.charge = charge


@final
class DeadCentre(Value):
    """The last dead centre exactly; number 0 means that there was none yet.

    `fuel_kg` is what burnt there, nought after a misfire; `lambda_ratio` that of its charge.
    """

    __slots__ = ("number", "t_ns", "x_m", "fuel_kg", "efficiency", "lambda_ratio")

    def __init__(
        self, number: int, t_ns: int, x_m: float, fuel_kg: float, efficiency: float,
        lambda_ratio: float = 0.0,
    ) -> None:  # fmt: skip
        self.number = number
        self.t_ns = t_ns
        self.x_m = x_m
        self.fuel_kg = fuel_kg
        self.efficiency = efficiency
        self.lambda_ratio = lambda_ratio


@final
@mypyc_attr(acyclic=True, free_list_len=1)
class PlantState(Value):
    """The truth at the start of a tick.

    lit: the charge that a spark has lit in this stroke, for engines that burn before the dead
        centre
    stale: ticks in a row without an answer that may be acted on
    latch: of the safe state (hil/wire/latch.py)
    waiting: commands that have arrived and do not act yet, the oldest first
    """

    __slots__ = (
        "tick", "motion", "stroke", "machine", "pulses", "disturbances", "dead_centre", "lit",
        "stale", "latch", "contacts", "waiting", "manifold", "instruments",
    )  # fmt: skip

    def __init__(
        self,
        tick: i64,
        motion: Motion,
        stroke: Stroke,
        machine: Machine,
        pulses: Actuation,
        disturbances: Disturbances,
        dead_centre: DeadCentre,
        lit: Charge,
        stale: i64,
        latch: i64,
        contacts: int,
        waiting: tuple[Command | None, ...],
        manifold: Manifold,
        instruments: Instruments = UNUSED,
    ) -> None:
        self.tick = tick
        self.motion = motion
        self.stroke = stroke
        self.machine = machine
        self.pulses = pulses
        self.disturbances = disturbances
        self.dead_centre = dead_centre
        self.lit = lit
        self.stale = stale
        self.latch = latch
        self.contacts = contacts
        self.waiting = waiting
        self.manifold = manifold
        self.instruments = instruments

    def but(
        self,
        *,
        motion: Motion | None = None,
        stroke: Stroke | None = None,
        machine: Machine | None = None,
        pulses: Actuation | None = None,
        disturbances: Disturbances | None = None,
        dead_centre: DeadCentre | None = None,
        lit: Charge | None = None,
        manifold: Manifold | None = None,
        instruments: Instruments | None = None,
    ) -> PlantState:
        """The same state with other parts, those that are named."""
        return PlantState(
            self.tick,
            motion or self.motion,
            stroke or self.stroke,
            machine or self.machine,
            pulses or self.pulses,
            disturbances or self.disturbances,
            dead_centre or self.dead_centre,
            lit or self.lit,
            self.stale,
            self.latch,
            self.contacts,
            self.waiting,
            manifold or self.manifold,
            instruments or self.instruments,
        )

    @property
    def x_m(self) -> float:
        """Position from mid-stroke, positive to the right head."""
        return self.motion.x_m

    @property
    def v_m_s(self) -> float:
        """Velocity, positive to the right head."""
        return self.motion.v_m_s

    @property
    def moving(self) -> bool:
        """Whether the piston is in motion."""
        return self.motion.moving
