"""What a charge does: whether it burns at the dead centre, and what force and stiffness it gives.

E = eta m_f Hu (R/Cv) / CR^(gamma-1), k = 2 gamma p0 A/Ls + gamma E/Ls^2, F = E/Ls, F0 = 4F/pi
(docs/model.md, eqs. 5 to 8; thesis eqs. 5.36, 5.56, 5.57).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from plant.params import Engine, PlantParams
from plant.rig.randoms import EFFICIENCY, uniform

LEFT = 0
RIGHT = 1
SIDES = ("left", "right")


class Stroke(NamedTuple):
    """One stroke: its start, the charge burnt there, and what that makes of the motion.

    `number` counts dead centres; `latched` says that the load cannot act before the next one.
    """

    number: int
    direction: int
    start_ns: int
    start_x_m: float
    fuel_kg: float = 0.0
    efficiency: float = 1.0
    energy_j: float = 0.0
    latched: bool = False


def energy_j(engine: Engine, fuel_kg: float, efficiency: float = 1.0) -> float:
    """E = eta m_f Hu (R/Cv) / CR^(gamma-1)     (thesis eqs. 5.36, 5.57)."""
    return efficiency * fuel_kg * engine.energy_j_kg


def stiffness_n_m(engine: Engine, energy: float) -> float:
    """Stiffness k = 2 gamma p0 A/Ls + gamma E/Ls^2     (thesis eq. 5.56)."""
    return engine.rest_stiffness_n_m + engine.gamma * energy / engine.half_stroke_m**2


def force_n(engine: Engine, energy: float) -> float:
    """F = E/Ls, half the height of the rectangular excitation     (thesis eq. 5.50)."""
    return energy / engine.half_stroke_m


def sine_force_n(engine: Engine, energy: float) -> float:
    """F0 = 4F/pi, its first harmonic     (thesis eqs. 5.53, 5.57)."""
    return 4.0 / math.pi * energy / engine.half_stroke_m


def misfire_reason(
    params: PlantParams, fuel_kg: float, spark_ns: int, t_ns: float, compressed: bool
) -> str:
    """Tell why a charge does not burn at the dead centre t_ns; an empty string when it does."""
    if fuel_kg <= 0.0:
        return "no fuel"
    if not compressed:
        return "no compression"
    if not params.fuel_min_kg <= fuel_kg <= params.fuel_max_kg:
        return f"fuel out of range ({fuel_kg * 1e6:.4f} mg)"
    if spark_ns < 0:
        return "no spark"
    if t_ns - spark_ns > params.spark_window_ns:
        return f"early spark ({(t_ns - spark_ns) * 1e-6:.3f} ms before the dead centre)"
    return ""


def efficiency(params: PlantParams, bounds: tuple[float, float] | None, index: int) -> float:
    """Draw the efficiency of the combustion at dead centre `index`; 1 when undisturbed."""
    if bounds is None:
        return 1.0
    low, high = bounds
    return low + (high - low) * uniform(params.seed, EFFICIENCY, index)
