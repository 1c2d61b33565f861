"""What the controller believes of its engine: the closed form of eq. 5.60, solved backwards.

The plant may differ (another model, other parameters); the loops take up the difference.
"""

from __future__ import annotations

import math
from typing import Final, final

from hil.config.prototypes import Prototype
from hil.roots import newton
from hil.values import Value

_NEWTON_STEPS: Final = 60


TUNED_FUEL_PER_SPEED_KG_S_M: Final = 1.4512e-6
"""Slope of fuel over mid-stroke speed at which the laws' gains were found (docs/tuning.md)."""

_SLOPE_STEP: Final = 0.01


@final
class OperatingPoint(Value):
    """A steady state: fuel a stroke [kg], speed at mid-stroke [m/s], duration of a stroke [s].

    fuel_per_speed_kg_s_m: by how much more fuel the steady speed rises, at the same load
    """

    __slots__ = ("fuel_kg", "v_mid_m_s", "stroke_s", "fuel_per_speed_kg_s_m")

    def __init__(
        self, fuel_kg: float, v_mid_m_s: float, stroke_s: float,
        fuel_per_speed_kg_s_m: float = TUNED_FUEL_PER_SPEED_KG_S_M,
    ) -> None:  # fmt: skip
        self.fuel_kg = fuel_kg
        self.v_mid_m_s = v_mid_m_s
        self.stroke_s = stroke_s
        self.fuel_per_speed_kg_s_m = fuel_per_speed_kg_s_m

    @property
    def gain_scale(self) -> float:
        """Factor on the gains from speed to fuel: an engine that needs less fuel gets less."""
        return self.fuel_per_speed_kg_s_m / TUNED_FUEL_PER_SPEED_KG_S_M


def operating_point(engine: Prototype, tdc_m: float, load_n_s_m: float) -> OperatingPoint:
    """Steady state of the phase-locked engine at a TDC and a load.

    X = F0 / (c omega) and m omega^2 = k0 + gamma E / Ls^2, with F0 = 4 E / (pi Ls), give
    m omega^2 - (pi gamma c X / (4 Ls)) omega - k0 = 0     (thesis eqs. 5.56 to 5.60)
    """
    fuel, v_mid, stroke = steady(engine, tdc_m, load_n_s_m)
    return OperatingPoint(fuel, v_mid, stroke, fuel_per_speed(engine, tdc_m, load_n_s_m))


def fuel_per_speed(engine: Prototype, tdc_m: float, load_n_s_m: float) -> float:
    """By how much more fuel the steady speed rises, at the same load [kg s/m]."""
    more_fuel, more_v, _ = steady(engine, tdc_m * (1.0 + _SLOPE_STEP), load_n_s_m)
    less_fuel, less_v, _ = steady(engine, tdc_m * (1.0 - _SLOPE_STEP), load_n_s_m)
    return (more_fuel - less_fuel) / (more_v - less_v)


def steady(engine: Prototype, tdc_m: float, load_n_s_m: float) -> tuple[float, float, float]:
    """Fuel, speed at mid-stroke and duration of a stroke of that steady state."""
    m, k0, Ls = engine.moving_mass_kg, engine.rest_stiffness_n_m, engine.half_stroke_m
    b = math.pi * engine.gamma * load_n_s_m * tdc_m / (4.0 * Ls)
    omega = (b + math.sqrt(b * b + 4.0 * m * k0)) / (2.0 * m)
    energy = math.pi * Ls * load_n_s_m * omega * tdc_m / 4.0
    return energy / engine.energy_j_kg, omega * tdc_m, math.pi / omega


def load_for_power(engine: Prototype, tdc_m: float, power_w: float) -> float:
    """Load coefficient at which the steady engine delivers a power [N s/m].

    P = c (X omega)^2 / 2, put into the equation of `operating_point`:
    m omega^2 - pi gamma P / (2 Ls X omega) - k0 = 0
    """
    m, k0, Ls = engine.moving_mass_kg, engine.rest_stiffness_n_m, engine.half_stroke_m
    d = math.pi * engine.gamma * power_w / (2.0 * Ls * tdc_m)

    def misfit(omega: float) -> tuple[float, float]:
        return m * omega**2 - d / omega - k0, 2.0 * m * omega + d / omega**2

    guess = math.sqrt(k0 / m) + math.cbrt(d / m)
    omega = newton(misfit, guess, relative=1e-12, steps=_NEWTON_STEPS)
    return 2.0 * power_w / (tdc_m * tdc_m * omega * omega)


def motoring_force(
    engine: Prototype, x_m: float, v_m_s: float, direction: float, amplitude_m: float
) -> float:
    """Force in the direction of motion that makes the next dead centre lie at an amplitude [N].

    F (X - d x) = k0 (X^2 - x^2 - m v^2 / k0) / 2: the work that the air springs still lack
    (thesis eq. 5.80 for k0; undamped). Negative where they hold more than that.
    """
    k0 = engine.rest_stiffness_n_m
    lacking = 0.5 * (k0 * (amplitude_m**2 - x_m**2) - engine.moving_mass_kg * v_m_s**2)
    way = max(amplitude_m - direction * x_m, 1e-3)
    return lacking / way
