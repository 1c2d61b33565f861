"""The engines by their published figures, and the constants that follow from them."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

MassKg = Annotated[float, Field(gt=0.01, le=1000.0)]
LengthM = Annotated[float, Field(gt=0.001, le=1.0)]
Ratio = Annotated[float, Field(gt=1.0, le=40.0)]
Gamma = Annotated[float, Field(gt=1.01, le=1.67)]
PressurePa = Annotated[float, Field(ge=1.0e4, le=1.0e7)]
TemperatureK = Annotated[float, Field(ge=200.0, le=1000.0)]
GasConstant = Annotated[float, Field(ge=100.0, le=5000.0)]
HeatingValue = Annotated[float, Field(ge=1.0e6, le=2.0e8)]
LoadCoefficient = Annotated[float, Field(ge=0.0, le=10_000.0)]
ForceN = Annotated[float, Field(ge=0.0, le=20_000.0)]
FuelKg = Annotated[float, Field(gt=0.0, le=1.0e-3)]
PositionM = Annotated[float, Field(ge=0.0, le=1.0)]


class Prototype(BaseModel):
    """One engine: geometry, charge, machine and the limits of its use (thesis Tables 3.2, 5.2)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    moving_mass_kg: MassKg
    bore_m: LengthM
    half_stroke_m: LengthM
    compression_ratio: Ratio
    gamma: Gamma
    p0_pa: PressurePa
    t0_k: TemperatureK
    gas_constant_j_kg_k: GasConstant
    heating_value_j_kg: HeatingValue
    air_fuel_ratio: Ratio
    load_coefficient_n_s_m: LoadCoefficient
    peak_force_n: ForceN
    ignition_from_head_m: PositionM
    tdc_ref_m: PositionM
    position_limit_m: PositionM
    fuel_min_kg: FuelKg
    fuel_max_kg: FuelKg

    @property
    def area_m2(self) -> float:
        """A = pi B^2 / 4     (thesis eq. 5.2)."""
        return math.pi * self.bore_m**2 / 4.0

    @property
    def cv_j_kg_k(self) -> float:
        """Cv = R / (gamma - 1), per kilogram."""
        return self.gas_constant_j_kg_k / (self.gamma - 1.0)

    @property
    def energy_j_kg(self) -> float:
        """E / m_f = Hu (R / Cv) / CR^(gamma - 1)     (thesis eqs. 5.36, 5.57, 6.1)."""
        ratio = self.gas_constant_j_kg_k / self.cv_j_kg_k
        return float(self.heating_value_j_kg * ratio / self.compression_ratio ** (self.gamma - 1.0))

    @property
    def rest_stiffness_n_m(self) -> float:
        """k0 = 2 gamma p0 A / Ls, the air springs alone     (thesis eq. 5.80)."""
        return 2.0 * self.gamma * self.p0_pa * self.area_m2 / self.half_stroke_m

    @property
    def full_throttle_fuel_kg(self) -> float:
        """m_fuel = p0 V0 / (R T0 AFR) at wide open throttle     (thesis eq. 5.28)."""
        air_kg = self.p0_pa * self.area_m2 * self.half_stroke_m
        return air_kg / (self.gas_constant_j_kg_k * self.t0_k * self.air_fuel_ratio)

    def stiffness_n_m(self, fuel_kg: float) -> float:
        """Stiffness k = 2 gamma p0 A / Ls + gamma E / Ls^2     (thesis eq. 5.56)."""
        energy_j = self.energy_j_kg * fuel_kg
        return self.rest_stiffness_n_m + self.gamma * energy_j / self.half_stroke_m**2


NU = Prototype(
    name="nu",
    moving_mass_kg=7.0,
    bore_m=0.050,
    half_stroke_m=0.020,
    compression_ratio=5.0,
    gamma=1.35,
    p0_pa=1.0e5,
    t0_k=298.15,
    gas_constant_j_kg_k=287.0,
    heating_value_j_kg=44.0e6,
    air_fuel_ratio=14.7,
    load_coefficient_n_s_m=810.0,
    peak_force_n=4000.0,
    ignition_from_head_m=0.005,
    tdc_ref_m=0.0155,
    position_limit_m=0.0195,
    fuel_min_kg=0.2e-6,
    fuel_max_kg=6.0e-6,
)

BIT = Prototype(
    name="bit",
    moving_mass_kg=5.0,
    bore_m=0.0525,
    half_stroke_m=0.035,
    compression_ratio=10.0,
    gamma=1.40,
    p0_pa=1.0e5,
    t0_k=298.15,
    gas_constant_j_kg_k=287.0,
    heating_value_j_kg=44.0e6,
    air_fuel_ratio=14.7,
    load_coefficient_n_s_m=395.0,
    peak_force_n=1000.0,
    ignition_from_head_m=0.007,
    tdc_ref_m=0.030,
    position_limit_m=0.0345,
    fuel_min_kg=0.2e-6,
    fuel_max_kg=6.0e-6,
)

GAS_SPRING = NU.model_copy(
    update={
        "name": "gas-spring", "moving_mass_kg": 25.0, "bore_m": 0.0825, "half_stroke_m": 0.050,
        "gamma": 1.32, "p0_pa": 1.3e5, "load_coefficient_n_s_m": 900.0, "peak_force_n": 5000.0,
        "ignition_from_head_m": 0.010, "tdc_ref_m": 0.0435, "position_limit_m": 0.0495,
        "fuel_max_kg": 40.0e-6,
    }
)  # fmt: skip
"""Single piston with a gas spring (thesis Table 2.9; hil/engines/gas-spring.toml)."""

OPPOSED = NU.model_copy(
    update={
        "name": "opposed", "moving_mass_kg": 5.4, "bore_m": 0.070, "half_stroke_m": 0.0325,
        "gamma": 1.32, "p0_pa": 1.5e5, "load_coefficient_n_s_m": 325.0, "peak_force_n": 5000.0,
        "ignition_from_head_m": 0.006, "tdc_ref_m": 0.0274, "position_limit_m": 0.032,
        "fuel_max_kg": 40.0e-6,
    }
)  # fmt: skip
"""Opposed pistons that move as one (thesis Table 2.6; hil/engines/opposed.toml)."""

MECHANICAL_SPRING = NU.model_copy(
    update={
        "name": "mechanical-spring", "moving_mass_kg": 10.0, "bore_m": 0.068,
        "half_stroke_m": 0.0425, "gamma": 1.28, "load_coefficient_n_s_m": 750.0,
        "ignition_from_head_m": 0.006, "tdc_ref_m": 0.0375, "position_limit_m": 0.042,
        "fuel_max_kg": 40.0e-6,
    }
)  # fmt: skip
"""Four-stroke with a mechanical spring (thesis section 2.3.4; its own calibration)."""

PROTOTYPES: dict[str, Prototype] = {
    e.name: e for e in (NU, BIT, GAS_SPRING, OPPOSED, MECHANICAL_SPRING)
}
SINGLE_CHAMBER = ("gas-spring", "opposed", "mechanical-spring")
"""Engines with one chamber that fires: the fast models, of two, do not describe them."""
