"""The parts of an engine in full: gas, mover, cylinders, breathing, heat, friction."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hil.config.base import Section
from hil.config.ranges import (
    FlowKgS,
    Gamma,
    GasConstant,
    HeatingValue,
    MassKg,
    PressurePa,
    Restitution,
    TemperatureK,
)

Metres = Annotated[float, Field(gt=0.0, le=1.0)]
Position = Annotated[float, Field(ge=-1.0, le=1.0)]
SquareMetres = Annotated[float, Field(ge=0.0, le=1.0)]


class Gas(Section):
    """Ideal gas with constant heat capacities, and the air around the engine."""

    gamma: Gamma
    gas_constant_j_kg_k: GasConstant
    ambient_pa: PressurePa
    ambient_k: TemperatureK


class Spring(Section):
    """A mechanical spring on the mover, relaxed at a position of it."""

    stiffness_n_m: float = Field(gt=0.0, le=1e7)
    relaxed_x_m: Position


class Mover(Section):
    """The moving mass, and what meets it at the ends."""

    mass_kg: MassKg
    contact_gap_m: Metres
    restitution: Restitution
    spring: Spring | None = None


class Side(Section):
    """One cylinder.

    fill_pa, fill_k: the gas enclosed at x = 0 at the start of a run
    walls: share of the surfaces that take up heat; 0 for an adiabatic gas
    pistons: 2 for opposed pistons that move as one; their chamber has no head
    rings: share of one piston's rings; 0 where no piston seals
    """

    bore_m: Metres
    length_m: Metres
    wall_k: TemperatureK
    walls: float = Field(default=1.0, ge=0.0, le=1.0)
    leak_m2: SquareMetres
    pistons: int = Field(default=1, ge=1, le=2)
    rings: float = Field(default=1.0, ge=0.0, le=4.0)
    fill_pa: PressurePa
    fill_k: TemperatureK


class Breathing(Section):
    """Valves or ports with a step profile: opening area C_d pi D L, and the gas beyond them.

    ports: opened and closed by the piston itself; there are no valve lines
    """

    ports: bool = False

    intake_diameter_m: Metres
    exhaust_diameter_m: Metres
    lift_m: Metres
    discharge: float = Field(gt=0.0, le=1.0)
    intake_pa: PressurePa
    intake_k: TemperatureK
    exhaust_pa: PressurePa
    exhaust_k: TemperatureK


class Pump(Section):
    """Scavenging pumps under the pistons (App. I eq. 21)."""

    volume_m3: float = Field(gt=0.0, le=0.1)
    area_m2: SquareMetres
    reed_m2: SquareMetres


class Heat(Section):
    """Heat release (3.21) and heat to the wall (3.18)."""

    wiebe_a: float = Field(gt=0.0, le=20.0)
    wiebe_b: float = Field(gt=0.0, le=10.0)
    burn_s: float = Field(gt=1e-4, le=0.1)
    hohenberg: float = Field(ge=0.0, le=20.0)
    energy_j: float = Field(ge=0.0, le=1e5)
    heating_value_j_kg: HeatingValue
    injector_kg_s: FlowKgS


class Friction(Section):
    """Parameterised friction (3.3, 3.4); oil_c is E, oil_reference_c theta_0."""

    machine_n: float = Field(ge=0.0, le=1000.0)
    f: float = Field(ge=0.0, le=100.0)
    a_f: float = Field(ge=0.0, le=1e4)
    b_f: float = Field(ge=-10.0, le=10.0)
    k_v: float = Field(ge=0.0, le=1.0)
    oil_c: float = Field(ge=-50.0, le=400.0)
    oil_reference_c: float = Field(gt=0.0, le=400.0)
    p_reference_pa: PressurePa
    bore_reference_m: Metres
