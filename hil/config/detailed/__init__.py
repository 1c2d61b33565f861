"""Calibration of a detailed engine: one TOML file a model, beside the engine's own figures."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.config.check import check
from hil.config.detailed.machine import Machine
from hil.config.detailed.parts import (
    Breathing,
    Friction,
    Gas,
    Heat,
    Metres,
    Mover,
    Position,
    Pump,
    Side,
)
from hil.config.plant import PlantConfig
from hil.config.prototypes import ENGINES, PROTOTYPES, Prototype, model_files
from hil.config.ranges import PressurePa
from hil.errors import ConfigError
from hil.nearest import listed
from hil.toml import Tree, read_toml

NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})
Newton = Annotated[float, Field(ge=-20_000.0, le=20_000.0)]

_OF_THE_ENGINE: Final = {
    "gas": {"gamma": "gamma", "gas_constant_j_kg_k": "gas_constant_j_kg_k"},
    "mover": {"mass_kg": "moving_mass_kg", "restitution": "contact_restitution"},
    "left": {"bore_m": "bore_m", "length_m": "half_stroke_m"},
    "right": {"bore_m": "bore_m", "length_m": "half_stroke_m"},
    "heat": {"heating_value_j_kg": "heating_value_j_kg", "injector_kg_s": "injector_kg_s"},
    "machine": {
        "load_coefficient_n_s_m": "load_coefficient_n_s_m",
        "peak_force_n": "peak_force_n",
        "start_force_n": "start_force_n",
    },
    "cycle": {
        "ignition_from_head_m": "ignition_from_head_m",
        "intake_closes_m": "intake_closes_m",
    },
}
"""What a calibration takes from the engine where it states nothing else, by table and key."""


class Cycle(Section):
    """Valve, spark and machine events by distance from the head they belong to.

    four-stroke: forces of Table 4.2, along the motion, and positions at which motor 2 and motor 4
    take over; motoring: `start_force_n` along the motion, no ignition; speed: the machine holds
    `speed_m_s` between two positions (Table 4.1), no ignition
    fires: both cylinders, or the left one alone against a spring on the right; the four strokes are
    then intake, compression, power, exhaust of the left one, and the machine drives the first
    """

    kind: Literal["two-stroke", "four-stroke", "motoring", "speed"]
    fires: Literal["both", "left"] = "both"
    ignition_from_head_m: Metres
    ignition_least_pa: PressurePa
    exhaust_opens_m: Metres | None = None
    exhaust_closes_m: Metres | None = None
    intake_opens_m: Metres | None = None
    intake_closes_m: Metres | None = None
    start_force_n: Newton = 0.0
    motor_1_n: Newton = 0.0
    motor_2_n: Newton = 0.0
    motor_3_n: Newton = 0.0
    motor_4_n: Newton = 0.0
    switch_1_m: Position = 0.0
    switch_4_m: Position = 0.0
    speed_m_s: float = Field(default=1.0, gt=0.0, le=10.0)
    turn_at_m: Metres = 1.0
    acceleration_m_s2: float = Field(default=1.0, gt=0.0, le=1e5)
    servo_s: float = Field(default=0.1, gt=1e-5, le=0.1)

    @model_validator(mode="after")
    def _speed_is_told(self) -> Self:
        needed = {"speed_m_s", "turn_at_m", "acceleration_m_s2", "servo_s"}
        if self.kind == "speed" and (absent := needed - self.model_fields_set):
            raise ValueError(f"kind = 'speed' needs {', '.join(sorted(absent))}")
        return self


class Running(Section):
    """Where the settled motion begins to be sought, and the solver's step."""

    start_x_m: Position
    start_left_pa: PressurePa
    start_left_k: float = Field(ge=200.0, le=4000.0)
    start_right_pa: PressurePa
    start_right_k: float = Field(ge=200.0, le=4000.0)
    start_spark_s: float = Field(ge=0.0, le=0.02)
    step_s: float = Field(ge=1e-7, le=1e-3)
    small_pressure_ratio: float = Field(ge=1e-6, le=0.05)


class Calibration(Section):
    """Everything that a detailed engine is made of."""

    name: str
    title: str
    gas: Gas
    mover: Mover
    left: Side
    right: Side
    breathing: Breathing
    pump: Pump | None = None
    heat: Heat
    friction: Friction
    machine: Machine
    cycle: Cycle
    running: Running


def ideal(c: Calibration) -> Calibration:
    """Leave heat to the wall and leakage out: App. I section 3.2 sets that model beside its own."""
    sides = {
        name: getattr(c, name).model_copy(update={"walls": 0.0, "leak_m2": 0.0})
        for name in ("left", "right")
    }
    return c.model_copy(update=sides)


def read_file(path: Path, engine: Prototype, own: Mapping[str, Any] = NOTHING) -> Calibration:
    """Read the calibration of one model of an engine.

    Parameters: own : tables of which single keys take the place of the file's
    Raises: ConfigError naming file, key and what is accepted
    """
    tree: Tree = read_toml(path)
    for table, keys in own.items():
        tree[table] = {**tree.get(table, {}), **keys}
    for table, keys in _OF_THE_ENGINE.items():
        given = tree.get(table)
        if isinstance(given, dict):
            tree[table] = {key: getattr(engine, figure) for key, figure in keys.items()} | given
    return check(Calibration, tree, str(path))


@lru_cache(maxsize=1)
def calibrations() -> dict[tuple[str, str], Calibration]:
    """Return all calibrations by model and prototype.

    Raises: ConfigError when one of them cannot be used
    """
    return {
        (model, prototype): read_file(path, PROTOTYPES[prototype])
        for prototype in PROTOTYPES
        for model, path in model_files(prototype).items()
    }


def of_plant(config: PlantConfig) -> Calibration:
    """Return the calibration of a plant's model and engine, its own figures put in.

    A figure that the calibration states itself is not taken from the engine.

    Raises: ConfigError when there is none, or a figure is none that it takes
    """
    known = calibrations()
    found = known.get((config.model, config.prototype))
    if found is None:
        accepted = ", ".join(f"{m} with {e}" for m, e in known)
        raise ConfigError(
            f"plant.model {config.model} has no calibration for plant.prototype "
            f"{config.prototype}; accepted: {accepted}"
        )
    given = config.engine.model_dump(exclude_none=True)
    if not given and not config.own.name:
        return found
    path = model_files(config.prototype)[config.model]
    taken = _taken_from_the_engine(path) & type(config.engine).model_fields.keys()
    for key in given.keys() - taken:
        raise ConfigError(
            f"plant.engine.{key}: model {config.model} takes none such from its engine; accepted "
            f"here: {', '.join(sorted(taken))}"
        )
    own = config.own.models.get(config.model, {})
    return read_file(path, config.resolved_prototype(), own)


def _taken_from_the_engine(path: Path) -> set[str]:
    """The engine's figures that a calibration takes: those that it does not state itself."""
    tree = read_toml(path)
    return {
        figure
        for table, keys in _OF_THE_ENGINE.items()
        for key, figure in keys.items()
        if isinstance(tree.get(table), dict) and key not in tree[table]
    }


@lru_cache(maxsize=1)
def literature() -> tuple[Calibration, ...]:
    """Engines of the literature (thesis chapter 2), to be studied by themselves.

    No controller runs them: some are faster than 8 m/s, the most that a position frame holds.

    Raises: ConfigError when one of them cannot be used
    """
    paths = sorted((ENGINES / "literature").glob("*.toml"))
    return tuple(check(Calibration, read_toml(path), str(path)) for path in paths)


def names() -> tuple[str, ...]:
    """The calibrations that come with the project."""
    return tuple(sorted(c.name for c in (*calibrations().values(), *literature())))


def read(name: str) -> Calibration:
    """Return the calibration of a name.

    Raises: ConfigError when there is none
    """
    for calibration in (*calibrations().values(), *literature()):
        if calibration.name == name:
            return calibration
    raise ConfigError(f"engine {name!r}: accepted are {listed(name, names())}")
