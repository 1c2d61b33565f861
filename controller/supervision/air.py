"""The air that a charge has, as far as the controller knows: from the throttle, with a lag."""

from __future__ import annotations

import math
from typing import Final, final

from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype

LEAST_THROTTLE: Final = 0.02

_STILL_PA: Final = 1.0
"""So near to where it ends the manifold has arrived."""


@final
class Air:
    """Section `air` of the configuration, read once for all ticks."""

    def __init__(self, config: ControllerConfig, engine: Prototype) -> None:
        air = config.air
        kelvin = engine.t0_k if air.temperature_k is None else air.temperature_k
        air_kg_pa = engine.area_m2 * engine.half_stroke_m / (engine.gas_constant_j_kg_k * kelvin)
        self.full_pa = engine.intake_pa if air.manifold_pa is None else air.manifold_pa
        self.limits = air.limit
        self.lambda_ref = air.lambda_ref
        self._lag_s = air.lag_s
        self._fuel_kg_pa = air_kg_pa / engine.air_fuel_ratio
        self._lambda_least = air.lambda_least
        self._fuel_max_kg = config.limits.fuel_max_kg

    def lambda_of(self, manifold_pa: float, fuel_kg: float) -> float:
        """Lambda = p V / (R T AFR m_fuel)     (thesis eq. 5.28)."""
        return manifold_pa * self._fuel_kg_pa / fuel_kg

    def most_kg(self, throttle: float, manifold_pa: float) -> float:
        """The most fuel that throttle or air admit [kg]."""
        if not self.limits:
            return self._fuel_max_kg * throttle
        return min(self._fuel_max_kg, manifold_pa * self._fuel_kg_pa / self._lambda_least)

    def followed_pa(self, manifold_pa: float, throttle: float, dt: float) -> float:
        """The manifold's pressure after some time at a throttle [Pa]."""
        end = throttle * self.full_pa
        gap = manifold_pa - end
        if -_STILL_PA < gap < _STILL_PA or self._lag_s <= 0.0:
            return end
        return end + gap * math.exp(-dt / self._lag_s)

    def throttle_for(self, fuel_kg: float, throttle: float) -> float:
        """Opening that gives a fuel its `lambda_ref`; without one, as it is."""
        if self.lambda_ref is None:
            return throttle
        wanted = self.lambda_ref * fuel_kg / (self.full_pa * self._fuel_kg_pa)
        return min(max(wanted, LEAST_THROTTLE), 1.0)
