"""The plant's constants, flattened once from the configuration for use in every tick."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, Protocol, cast

from hil.config.plant import DETAILED_MODELS, PlantConfig, PlantEvent, SensorConfig
from hil.errors import ConfigError
from hil.prototypes import Prototype
from plant.engines.fast.nonlinear import CONTACT_GAP_M
from plant.rig.disturbances import Edge, compile_edges

if TYPE_CHECKING:
    from plant.rig.events import Event
    from plant.rig.state import Command, PlantState

SECOND_NS = 1_000_000_000

# No combustion may be lost to the last digit of a fuel mass at the edge of the range.
_FUEL_TOLERANCE_KG = 0.5e-9


class Engine(NamedTuple):
    """What the equations of motion need (docs/model.md, table 1)."""

    model: str
    mass_kg: float
    area_m2: float
    half_stroke_m: float
    contact_m: float
    compression_ratio: float
    gamma: float
    p0_pa: float
    energy_j_kg: float
    rest_stiffness_n_m: float
    restitution: float


class WholePlant(Protocol):
    """An engine that solves its ticks itself, with pulses, machine and disturbances."""

    def initial(
        self, p: PlantParams, rest: PlantState, fuel_kg: float | None, load_n_s_m: float | None
    ) -> PlantState:
        """Begin at rest when `fuel_kg` is None, else at the left dead centre of settled running."""

    def step(
        self, p: PlantParams, s: PlantState, command: Command | None
    ) -> tuple[PlantState, tuple[Event, ...]]:
        """Integrate exactly one tick with the command now in force."""


class PlantParams(NamedTuple):
    """Everything constant in a run."""

    engine: Engine
    dt_s: float
    period_ns: int
    stale_ticks: int
    load_coefficient_n_s_m: float
    peak_force_n: float
    spark_window_ns: float
    flow_kg_s: tuple[float, float]
    dead_time_ns: float
    fuel_min_kg: float
    fuel_max_kg: float
    sensors: SensorConfig
    noisy: bool
    seed: int
    names: tuple[str, ...]
    events: tuple[PlantEvent, ...]
    edges: tuple[Edge, ...]
    delay_ticks: int = 0
    detailed: WholePlant | None = None


def engine_of(prototype: Prototype, model: str, restitution: float = 0.5) -> Engine:
    """Flatten a prototype for the equations of motion."""
    gap = CONTACT_GAP_M if model == "nonlinear" else 0.0
    return Engine(
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


_WHOLE: dict[str, str] = dict.fromkeys(DETAILED_MODELS, "plant.engines.detailed.plant") | {
    "fmu": "plant.engines.fmu.plant"
}


def _whole(config: PlantConfig) -> WholePlant | None:
    """Build the engine of a model that solves its ticks itself; no other needs its library."""
    module = _WHOLE.get(config.model)
    return None if module is None else cast(WholePlant, import_module(module).build(config))


def plant_params(
    config: PlantConfig,
    period_ns: int,
    seed: int = 0,
    events: Mapping[str, PlantEvent] | None = None,
) -> PlantParams:
    """Flatten a configuration.

    Raises: ConfigError when the period is outside 10 us to 10 ms
    """
    if not 10_000 <= period_ns <= 10_000_000:
        raise ConfigError(f"plant period {period_ns} ns is outside 10000 to 10000000 ns")
    prototype = config.resolved_prototype()
    injector = config.injector
    flow = injector.static_flow_kg_s
    named = dict(events or {})
    return PlantParams(
        engine=engine_of(prototype, config.model, config.contact_restitution),
        dt_s=period_ns / SECOND_NS,
        period_ns=period_ns,
        stale_ticks=config.stale_ticks,
        load_coefficient_n_s_m=prototype.load_coefficient_n_s_m,
        peak_force_n=prototype.peak_force_n,
        spark_window_ns=config.spark_window_s * SECOND_NS,
        flow_kg_s=(flow * injector.flow_scale_left, flow * injector.flow_scale_right),
        dead_time_ns=injector.dead_time_s * SECOND_NS,
        fuel_min_kg=prototype.fuel_min_kg - _FUEL_TOLERANCE_KG,
        fuel_max_kg=prototype.fuel_max_kg + _FUEL_TOLERANCE_KG,
        sensors=config.sensors,
        noisy=any(config.sensors.model_dump().values()),
        seed=seed,
        names=tuple(named),
        events=tuple(named.values()),
        edges=compile_edges(tuple(named.values())),
        delay_ticks=config.command_delay_ticks,
        detailed=_whole(config),
    )
