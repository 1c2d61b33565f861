"""The engines by their published figures, and the constants that follow from them.

hil/engines/<name>/engine.toml is the only source of the figures.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import TracebackType
from typing import Any

from pydantic import Field

from hil import compiled
from hil.config.base import Section
from hil.config.check import check
from hil.config.ranges import (
    DeadTimeS,
    FlowKgS,
    ForceN,
    FuelKg,
    Gamma,
    GasConstant,
    HeatingValue,
    LengthM,
    LoadCoefficient,
    MassKg,
    PositionM,
    PressurePa,
    Ratio,
    Restitution,
    StartForceN,
    TdcRefM,
    TemperatureK,
)
from hil.errors import ConfigError
from hil.nearest import listed
from hil.toml import read_toml

ENGINES = compiled.root() / "hil" / "engines"
"""A directory an engine: its own figures, and a file for each model of its gas in full."""

_FIGURES = "engine.toml"


class Figures(Section):
    """What a run may replace one by one: geometry, charge, machine and limits of use."""

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
    peak_force_n: ForceN
    ignition_from_head_m: PositionM
    tdc_ref_m: TdcRefM
    position_limit_m: PositionM
    fuel_min_kg: FuelKg
    fuel_max_kg: FuelKg


class Prototype(Figures):
    """One engine (thesis Tables 3.2, 5.2).

    chambers: how many fire; the fast models, of two, do not describe an engine with one
    intake_pa: pressure in the intake manifold behind an open throttle
    intake_closes_m: distance from a head at which its intake closes
    open_loop_fuel_kg: fuel of open-loop operation; None: what wide open throttle lets in
    """

    name: str
    chambers: int = Field(ge=1, le=2)
    load_coefficient_n_s_m: LoadCoefficient
    start_force_n: StartForceN
    contact_restitution: Restitution
    open_loop_fuel_kg: FuelKg | None = None
    intake_pa: PressurePa
    intake_closes_m: LengthM
    injector_kg_s: FlowKgS
    injector_dead_s: DeadTimeS

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

    @property
    def fixed_fuel_kg(self) -> float:
        """Fuel of open-loop operation; at wide open throttle as far as an injector can feed it.

        The models of one engine share the figure, so that their motions can be compared; on that of
        the Newcastle engine the non-linear model strikes the head.
        """
        if self.open_loop_fuel_kg is None:
            return min(self.full_throttle_fuel_kg, self.fuel_max_kg)
        return self.open_loop_fuel_kg

    def stiffness_n_m(self, fuel_kg: float) -> float:
        """Stiffness k = 2 gamma p0 A / Ls + gamma E / Ls^2     (thesis eq. 5.56)."""
        energy_j = self.energy_j_kg * fuel_kg
        return self.rest_stiffness_n_m + self.gamma * energy_j / self.half_stroke_m**2


def read(directory: Path) -> Prototype:
    """Read the figures of an engine.

    Raises: ConfigError naming file, key and what is accepted
    """
    path = directory / _FIGURES
    return check(Prototype, read_toml(path) | {"name": directory.name}, str(path))


def read_own(path: Path) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Read an engine of the user's own: `like`, figures that differ, and tables by model.

    Returns: the prototype that it is like, its figures, and its tables `[MODEL.TABLE]`
    Raises: ConfigError naming file, key and what is accepted
    """
    tree = dict(read_toml(path))
    like = tree.pop("like", DEFAULT.name)
    if like not in PROTOTYPES:
        raise ConfigError(f"{path}: like = {like!r}: accepted: {listed(like, PROTOTYPES)}")
    tables = {key: tree.pop(key) for key in list(tree) if isinstance(tree[key], dict)}
    for model in tables:
        if model not in model_files(like):
            known = ", ".join(f"[{name}.TABLE]" for name in model_files(like))
            raise ConfigError(f"{path}: [{model}]: {like} has: {known or 'no such model'}")
    check(Prototype, PROTOTYPES[like].model_dump() | tree, str(path))
    return like, tree, tables


def model_files(prototype: str) -> dict[str, Path]:
    """Return by model the files of its models of the gas in full."""
    found = sorted((ENGINES / prototype).glob("*.toml"))
    return {path.stem: path for path in found if path.name != _FIGURES}


def engine_with(model: str) -> str:
    """Return the engine that is meant where none is named: the default one, if it has the model."""
    having = [name for name in PROTOTYPES if model in model_files(name)]
    return having[0] if having and DEFAULT.name not in having else DEFAULT.name


def _told(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Say in one line what is wrong with an engine, since no command has begun that would."""
    if not isinstance(error, ConfigError):
        sys.__excepthook__(kind, error, trace)
        return
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code)


def _read_all() -> dict[str, Prototype]:
    """Read the figures of all engines, which happens while the modules are imported."""
    try:
        return {p.parent.name: read(p.parent) for p in sorted(ENGINES.glob(f"*/{_FIGURES}"))}
    except ConfigError:
        sys.excepthook = _told
        raise


PROTOTYPES: dict[str, Prototype] = _read_all()
NU, BIT = PROTOTYPES["nu"], PROTOTYPES["bit"]
DEFAULT = NU
"""The engine that is meant where none is named."""
