"""The air of a charge: throttle to manifold pressure, trapped mass, and what it lets burn.

The manifold follows the throttle with a lag of the first order,  tau dp/dt = theta p_full - p;  a
charge traps  m_air = p V / (R T)  of it, V = A Ls (thesis eq. 5.28), and burns with
lambda = m_air / (AFR m_fuel).
"""

from __future__ import annotations

import math
from typing import final

from mypy_extensions import i64

from hil.config.plant import AirConfig
from hil.config.prototypes import Prototype
from hil.values import Value


@final
class Intake(Value):
    """What does not change: pressure of the open throttle, lag, and what a charge takes in.

    air_kg_pa: mass of trapped air by manifold pressure; limits: whether it limits what burns
    rich, lean: lambda outside of which nothing burns; kelvin: temperature of that air
    """

    __slots__ = (
        "full_pa",
        "lag_ns",
        "air_kg_pa",
        "air_fuel_ratio",
        "limits",
        "rich",
        "lean",
        "kelvin",
    )

    def __init__(
        self, full_pa: float, lag_ns: float, air_kg_pa: float, air_fuel_ratio: float, limits: bool,
        rich: float, lean: float, kelvin: float,
    ) -> None:  # fmt: skip
        self.full_pa = full_pa
        self.lag_ns = lag_ns
        self.air_kg_pa = air_kg_pa
        self.air_fuel_ratio = air_fuel_ratio
        self.limits = limits
        self.rich = rich
        self.lean = lean
        self.kelvin = kelvin

    def lambda_of(self, air_kg: float, fuel_kg: float) -> float:
        """Lambda = m_air / (AFR m_fuel), nought without fuel."""
        return air_kg / (self.air_fuel_ratio * fuel_kg) if fuel_kg > 0.0 else 0.0

    def objection(self, air_kg: float, fuel_kg: float) -> str:
        """Tell why a mixture does not burn; an empty string when it does."""
        if not self.limits:
            return ""
        ratio = self.lambda_of(air_kg, fuel_kg)
        if self.rich <= ratio <= self.lean:
            return ""
        return f"too {'rich' if ratio < self.rich else 'lean'} (lambda {ratio:.2f})"

    def burnt_kg(self, air_kg: float, fuel_kg: float) -> float:
        """Fuel for which there is air [kg]."""
        return min(fuel_kg, air_kg / self.air_fuel_ratio) if self.limits else fuel_kg


@final
class Manifold(Value):
    """Throttle, and the manifold's pressure at an instant, from which on it follows the throttle.

    full_pa: pressure of the open throttle; at the throttle's share of it the manifold ends
    """

    __slots__ = ("throttle", "full_pa", "lag_ns", "t_ns", "p_pa")

    def __init__(
        self, throttle: float, full_pa: float, lag_ns: float, t_ns: i64, p_pa: float
    ) -> None:
        self.throttle = throttle
        self.full_pa = full_pa
        self.lag_ns = lag_ns
        self.t_ns = t_ns
        self.p_pa = p_pa

    def pressure_pa(self, t_ns: i64) -> float:
        """The pressure at a time: the exact solution of the lag [Pa]."""
        end = self.throttle * self.full_pa
        if self.p_pa == end or self.lag_ns <= 0.0:
            return end
        return end + (self.p_pa - end) * math.exp(-float(t_ns - self.t_ns) / self.lag_ns)


def still(intake: Intake, throttle: float) -> Manifold:
    """The manifold that has been at a throttle for long."""
    return Manifold(throttle, intake.full_pa, intake.lag_ns, 0, throttle * intake.full_pa)


def moved(m: Manifold, throttle: float, full_pa: float, t_ns: i64) -> Manifold:
    """Let throttle and supply be others from a time on."""
    return Manifold(throttle, full_pa, m.lag_ns, t_ns, m.pressure_pa(t_ns))


def intake_of(config: AirConfig, engine: Prototype) -> Intake:
    """Flatten the configuration of the air path and the figures of its engine."""
    full_pa = engine.intake_pa if config.manifold_pa is None else config.manifold_pa
    kelvin = engine.t0_k if config.temperature_k is None else config.temperature_k
    volume_m3 = engine.area_m2 * engine.half_stroke_m
    return Intake(
        full_pa, config.lag_s * 1e9, volume_m3 / (engine.gas_constant_j_kg_k * kelvin),
        engine.air_fuel_ratio, config.limit, config.rich_limit, config.lean_limit, kelvin,
    )  # fmt: skip
