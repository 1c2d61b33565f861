"""The rig's constants, flattened once from the configuration for use in every tick."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, final

from mypy_extensions import i64

from hil.config.charge.injection import InjectorConfig
from hil.config.plant import PlantConfig, SensorConfig
from hil.config.ranges import stale_ticks
from hil.errors import ConfigError
from hil.values import Value
from hil.wire.commands import TimedCommand
from plant.engines.protocol import Engine
from plant.rig.actuation import Injector
from plant.rig.air import Intake, intake_of
from plant.rig.disturbances import Edge, compile_edges
from plant.rig.ignition import Ignition, ignition_of
from plant.rig.port import wall_of
from plant.rig.valves import ValveActuators, actuators_of

SECOND_NS: Final = 1_000_000_000

# No combustion may be lost to the last digit of a fuel mass at the edge of the range.
_FUEL_TOLERANCE_KG: Final = 0.5e-9


@final
class PlantParams(Value):
    """What does not change within a tick; `names`, `events` and `edges` are the disturbances.

    config: what the rest follows from, but for the engine, which stays as it was built
    rearm: the safe state ends when answers return, and needs no start
    instrumented: whether pressures of cycles, or the winding, are measured
    """

    __slots__ = (
        "config", "engine", "dt_s", "period_ns", "stale_ticks", "load_coefficient_n_s_m",
        "peak_force_n", "spark_window_ns", "injector", "fuel_min_kg", "fuel_max_kg", "sensors",
        "noisy", "seed", "names", "events", "edges", "delay_ticks", "rearm", "valves", "intake",
        "ignition", "instrumented",
    )  # fmt: skip

    def __init__(
        self, config: PlantConfig, engine: Engine, dt_s: float, period_ns: int, stale_ticks: i64,
        load_coefficient_n_s_m: float, peak_force_n: float, spark_window_ns: float,
        injector: Injector, fuel_min_kg: float, fuel_max_kg: float, sensors: SensorConfig,
        noisy: bool, seed: int, names: tuple[str, ...], events: tuple[TimedCommand, ...],
        edges: tuple[Edge, ...], delay_ticks: i64, rearm: bool, valves: ValveActuators,
        intake: Intake, ignition: Ignition, instrumented: bool = False,
    ) -> None:  # fmt: skip
        self.config = config
        self.engine = engine
        self.dt_s = dt_s
        self.period_ns = period_ns
        self.stale_ticks = stale_ticks
        self.load_coefficient_n_s_m = load_coefficient_n_s_m
        self.peak_force_n = peak_force_n
        self.spark_window_ns = spark_window_ns
        self.injector = injector
        self.fuel_min_kg = fuel_min_kg
        self.fuel_max_kg = fuel_max_kg
        self.sensors = sensors
        self.noisy = noisy
        self.seed = seed
        self.names = names
        self.events = events
        self.edges = edges
        self.delay_ticks = delay_ticks
        self.rearm = rearm
        self.valves = valves
        self.intake = intake
        self.ignition = ignition
        self.instrumented = instrumented


def injector_of(config: InjectorConfig, half_stroke_m: float) -> Injector:
    """Return the injectors: both flows, with what each lacks of the nominal one, and their port."""
    flow = config.static_flow_kg_s
    return Injector(
        (flow * config.flow_scale_left, flow * config.flow_scale_right),
        config.dead_time_s * SECOND_NS,
        wall_of(config, half_stroke_m),
    )


def window_ns(window_s: float | None) -> float:
    """The longest time from spark to dead centre; without one compression alone tells [ns]."""
    return math.inf if window_s is None else window_s * SECOND_NS


def is_noisy(config: SensorConfig) -> bool:
    """Whether the sensors say anything but the truth."""
    return any(config.__dict__.values())


def checked_period_ns(period_ns: int) -> int:
    """Return the period.

    Raises: ConfigError when it is outside 10 us to 10 ms
    """
    if not 10_000 <= period_ns <= 10_000_000:
        raise ConfigError(f"plant period {period_ns} ns is outside 10000 to 10000000 ns")
    return period_ns


def rig_params(
    config: PlantConfig,
    engine: Engine,
    period_ns: int,
    seed: int,
    events: Mapping[str, TimedCommand],
    rearm: bool = False,
) -> PlantParams:
    """Flatten a configuration around an engine that is built."""
    prototype = config.resolved_prototype()
    return PlantParams(
        config=config,
        engine=engine,
        dt_s=period_ns / SECOND_NS,
        period_ns=period_ns,
        stale_ticks=stale_ticks(config.stale_s, period_ns),
        load_coefficient_n_s_m=prototype.load_coefficient_n_s_m,
        peak_force_n=prototype.peak_force_n,
        spark_window_ns=window_ns(config.spark_window_s),
        injector=injector_of(config.injector, prototype.half_stroke_m),
        fuel_min_kg=prototype.fuel_min_kg - _FUEL_TOLERANCE_KG,
        fuel_max_kg=prototype.fuel_max_kg + _FUEL_TOLERANCE_KG,
        sensors=config.sensors,
        noisy=is_noisy(config.sensors),
        seed=seed,
        names=tuple(events),
        events=tuple(events.values()),
        edges=compile_edges(tuple(events.values())),
        delay_ticks=config.command_delay_ticks,
        rearm=rearm,
        valves=actuators_of(
            config.valves, seed, engine.valve_lift_m, config.disturbance.exhaust_late_s
        ),
        intake=intake_of(config.air, prototype),
        instrumented=config.indicator.on or config.winding.on,
        ignition=ignition_of(config.ignition, prototype),
    )
