"""A change of the plant's configuration while it runs: the parameters that follow from it."""

from __future__ import annotations

from collections.abc import Mapping

from hil.config.plant import PlantConfig
from hil.config.ranges import stale_ticks
from hil.errors import ConfigError
from hil.names.parameters import apply
from hil.values import replace
from plant.engines.own.model import OwnEngine
from plant.rig.disturbances import objection
from plant.rig.events import Event
from plant.rig.ignition import ignition_of
from plant.rig.orders import obey
from plant.rig.params import PlantParams, injector_of, is_noisy, window_ns
from plant.rig.state import PlantState
from plant.rig.stroke import act
from plant.rig.valves import late_ns


def retuned(p: PlantParams, config: PlantConfig) -> PlantParams:
    """Return the parameters by another configuration; an engine of ours stays as it was built.

    Raises: ConfigError for settings that an engine of the user's does not accept, and for what
        this plant does not have
    """
    if reason := objection(config):
        raise ConfigError(reason)
    load_n_s_m, engine = config.load_coefficient_n_s_m, p.engine
    if isinstance(engine, OwnEngine):
        engine = engine.remade(config)
    return replace(
        p,
        config=config,
        engine=engine,
        load_coefficient_n_s_m=p.load_coefficient_n_s_m if load_n_s_m is None else load_n_s_m,
        stale_ticks=stale_ticks(config.stale_s, p.period_ns),
        spark_window_ns=window_ns(config.spark_window_s),
        ignition=ignition_of(config.ignition, config.resolved_prototype()),
        injector=injector_of(config.injector, config.resolved_prototype().half_stroke_m),
        valves=replace(p.valves, exhaust_late_ns=late_ns(config.disturbance.exhaust_late_s)),
        sensors=config.sensors,
        noisy=is_noisy(config.sensors),
    )


def changed(p: PlantParams, values: Mapping[str, object]) -> PlantParams:
    """Return the parameters with other values, by their keys.

    Raises: ConfigError for what is not accepted
    """
    return retuned(p, apply(p.config, values))


def enforced(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Let the order in force act by the parameters of now: another load, another motion."""
    machine = obey(p, s.machine.order, s.disturbances.load_scale)
    if machine == s.machine:
        return s
    return act(p, s.but(machine=machine), s.tick * p.period_ns, events)
