"""A change of the plant's configuration while it runs: the parameters that follow from it."""

from __future__ import annotations

from hil.config.plant import PlantConfig
from hil.config.ranges import stale_ticks
from hil.values import replace
from plant.rig.events import Event
from plant.rig.orders import obey
from plant.rig.params import SECOND_NS, PlantParams, injector_of, is_noisy
from plant.rig.state import PlantState
from plant.rig.stroke import act


def retuned(p: PlantParams, config: PlantConfig) -> PlantParams:
    """Return the parameters by another configuration; the engine stays as it was built."""
    return replace(
        p,
        config=config,
        stale_ticks=stale_ticks(config.stale_s, p.period_ns),
        spark_window_ns=config.spark_window_s * SECOND_NS,
        injector=injector_of(config.injector),
        sensors=config.sensors,
        noisy=is_noisy(config.sensors),
    )


def enforced(p: PlantParams, s: PlantState, events: list[Event]) -> PlantState:
    """Let the order in force act by the parameters of now: another load, another motion."""
    machine = obey(p, s.machine.order, s.disturbances.load_scale)
    if machine == s.machine:
        return s
    return act(p, s.but(machine=machine), s.tick * p.period_ns, events)
