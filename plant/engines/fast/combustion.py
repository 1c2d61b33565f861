"""What force and stiffness a burning charge gives.

E = eta m_f Hu (R/Cv) / CR^(gamma-1), k = 2 gamma p0 A/Ls + gamma E/Ls^2, F = E/Ls, F0 = 4F/pi
(docs/model.md, eqs. 5 to 8; thesis eqs. 5.36, 5.56, 5.57).
"""

from __future__ import annotations

import math
from typing import final

from hil.values import Value
from plant.engines.fast.constants import Constants


@final
class Burn(Value):
    """What burns behind the piston in a stroke, and which way it drives.

    latched: the load cannot act before the next dead centre (eq. 5.60 gives it beforehand)
    """

    __slots__ = ("direction", "energy_j", "latched")

    def __init__(self, direction: int, energy_j: float, latched: bool = False) -> None:
        self.direction = direction
        self.energy_j = energy_j
        self.latched = latched


def energy_j(constants: Constants, fuel_kg: float, efficiency: float = 1.0) -> float:
    """E = eta m_f Hu (R/Cv) / CR^(gamma-1)     (thesis eqs. 5.36, 5.57)."""
    return efficiency * fuel_kg * constants.energy_j_kg


def stiffness_n_m(constants: Constants, energy: float) -> float:
    """Stiffness k = 2 gamma p0 A/Ls + gamma E/Ls^2     (thesis eq. 5.56)."""
    return constants.rest_stiffness_n_m + constants.gamma * energy / constants.half_stroke_m**2


def force_n(constants: Constants, energy: float) -> float:
    """F = E/Ls, half the height of the rectangular excitation     (thesis eq. 5.50)."""
    return energy / constants.half_stroke_m


def sine_force_n(constants: Constants, energy: float) -> float:
    """F0 = 4F/pi, its first harmonic     (thesis eqs. 5.53, 5.57)."""
    return 4.0 / math.pi * energy / constants.half_stroke_m
