"""What the equations of motion of a fast-response engine need (docs/model.md, table 1)."""

from __future__ import annotations

from typing import final

from hil.config.prototypes import Prototype
from hil.values import Value
from plant.engines.fast.nonlinear import CONTACT_GAP_M


@final
class Constants(Value):
    """One engine as one model sees it."""

    __slots__ = (
        "model", "mass_kg", "area_m2", "half_stroke_m", "contact_m", "compression_ratio", "gamma",
        "p0_pa", "energy_j_kg", "rest_stiffness_n_m", "restitution",
    )  # fmt: skip

    def __init__(
        self,
        model: str,
        mass_kg: float,
        area_m2: float,
        half_stroke_m: float,
        contact_m: float,
        compression_ratio: float,
        gamma: float,
        p0_pa: float,
        energy_j_kg: float,
        rest_stiffness_n_m: float,
        restitution: float,
    ) -> None:
        self.model = model
        self.mass_kg = mass_kg
        self.area_m2 = area_m2
        self.half_stroke_m = half_stroke_m
        self.contact_m = contact_m
        self.compression_ratio = compression_ratio
        self.gamma = gamma
        self.p0_pa = p0_pa
        self.energy_j_kg = energy_j_kg
        self.rest_stiffness_n_m = rest_stiffness_n_m
        self.restitution = restitution


def constants_of(prototype: Prototype, model: str, restitution: float = 0.5) -> Constants:
    """Flatten a prototype for the equations of motion."""
    gap = CONTACT_GAP_M if model == "nonlinear" else 0.0
    return Constants(
        model=model,
        mass_kg=prototype.moving_mass_kg,
        area_m2=prototype.area_m2,
        half_stroke_m=prototype.half_stroke_m,
        contact_m=prototype.half_stroke_m - gap,
        compression_ratio=prototype.compression_ratio,
        gamma=prototype.gamma,
        p0_pa=prototype.p0_pa,
        energy_j_kg=prototype.energy_j_kg,
        rest_stiffness_n_m=prototype.rest_stiffness_n_m,
        restitution=restitution,
    )
