"""Faults put into controller and plant, one at a time, to see which expectation notices any."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from hil.config.load import with_override
from hil.config.resolved import Resolved
from hil.toml import Tree

Changes = Mapping[str, Any]

_PLANT: Final[Mapping[str, Changes]] = {
    "injectors give 60 %": {
        "plant.injector.flow_scale_left": 0.6, "plant.injector.flow_scale_right": 0.6,
    },
    "injectors give 150 %": {
        "plant.injector.flow_scale_left": 1.5, "plant.injector.flow_scale_right": 1.5,
    },
    "one injector gives 80 %": {"plant.injector.flow_scale_left": 0.8},
    "sensors are noisy": {"plant.sensors.noise_x_m": 1e-4, "plant.sensors.noise_v_m_s": 0.2},
    "orders come twenty ticks late": {"plant.command_delay_ticks": 20},
}  # fmt: skip

_CONTROLLER: Final[Mapping[str, Changes]] = {
    "fuel stays as it is": {"controller.name": "open-loop"},
    "little fuel whatever happens": {"controller.name": "open-loop", "fuel": 0.75},
    "much fuel whatever happens": {"controller.name": "open-loop", "fuel": 1.5},
    "most fuel whatever happens": {"controller.name": "open-loop", "fuel": 3.0},
    "set point 1 mm too low": {"set_point_m": -1.0e-3},
    "set point 1 mm too high": {"set_point_m": 1.0e-3},
    "fuel is limited": {"fuel_limit": 0.8},
    "no start is followed": {"without": "start"},
    "gains ten times as high": {"gains": 10.0},
    "gains are nothing": {"gains": 0.0},
}
"""Keys, and what is worked out: fuel as a share, set point as a difference, gains as a factor."""

_EVENTS: Final[Mapping[str, tuple[Tree, ...]]] = {
    "no charge burns": ({"kind": "misfire", "count": 1000},),
    "the load is lost": ({"kind": "load-scale", "value": 0.0},),
    "the load is three times as high": ({"kind": "load-scale", "value": 3.0},),
    "the load is half as high": ({"kind": "load-scale", "value": 0.5},),
    "charges burn badly": ({"kind": "efficiency", "low": 0.3, "high": 1.0},),
    "the position sensor hangs": ({"kind": "sensor-fault", "signal": "x", "duration_s": 1e3},),
    "the position is 2 mm off": (
        {"kind": "sensor-fault", "signal": "x", "substitute": "offset", "value": 2e-3,
         "duration_s": 1e3},
    ),
    "the velocity is 10 % off": (
        {"kind": "sensor-fault", "signal": "v", "substitute": "offset", "value": 0.2,
         "duration_s": 1e3},
    ),
    "the engine is stopped": ({"kind": "stop"},),
    "the load and every charge are lost": (
        {"kind": "load-scale", "value": 0.0}, {"kind": "misfire", "count": 1000},
    ),
}  # fmt: skip


class Mutant(NamedTuple):
    """One fault, and the whole configuration of a run with it."""

    name: str
    tree: Tree


def mutants(scenario: Resolved, instants_s: Sequence[float]) -> Iterator[Mutant]:
    """Yield the scenario with one fault each, those that are likeliest to be noticed first.

    What the controller knows of the engine stays what it was: a fault is none that it is told of.

    Parameters: instants_s : when faults that have a beginning begin
    """
    base = scenario.model_dump()
    for at_s in instants_s:
        for name, events in _EVENTS.items():
            yield Mutant(f"{name} at {at_s:.3g} s", _with_events(base, events, at_s))
    for name, changes in {**_CONTROLLER, **_PLANT}.items():
        yield Mutant(name, _changed(base, changes))
    yield from _without_events(base)


def _with_events(base: Tree, events: Sequence[Tree], at_s: float) -> Tree:
    added = {f"fault-{n}": {**event, "at_s": at_s} for n, event in enumerate(events)}
    return {**base, "events": {**base["events"], **added}}


def _without_events(base: Tree) -> Iterator[Mutant]:
    """What the scenario does to the engine does not happen."""
    for table in ("events", "stimuli"):
        for name in base[table]:
            rest = {other: event for other, event in base[table].items() if other != name}
            yield Mutant(f"{name} does not happen", {**base, table: rest})


def _changed(base: Tree, changes: Changes) -> Tree:
    tree = base
    for key, value in changes.items():
        tree = (
            _WORKED_OUT[key](tree, value) if key in _WORKED_OUT else with_override(tree, key, value)
        )
    return tree


def _fuel(tree: Tree, share: float) -> Tree:
    fuel_kg = tree["controller"]["preset"]["fuel_kg"] * share
    tree = with_override(tree, "controller.limits.fuel_max_kg", max(fuel_kg, _most_kg(tree)))
    return with_override(tree, "controller.open_loop.fuel_kg", fuel_kg)


def _most_kg(tree: Tree) -> float:
    return float(tree["controller"]["limits"]["fuel_max_kg"])


def _fuel_limit(tree: Tree, share: float) -> Tree:
    fuel_kg = tree["controller"]["preset"]["fuel_kg"] * share
    return with_override(tree, "controller.limits.fuel_max_kg", fuel_kg)


def _set_point(tree: Tree, difference_m: float) -> Tree:
    tdc_m = tree["controller"]["tdc_ref_m"] + difference_m
    return with_override(tree, "controller.tdc_ref_m", tdc_m)


def _gains(tree: Tree, factor: float) -> Tree:
    """Scale every proportional and integral gain of the controller."""
    return {**tree, "controller": _scaled(tree["controller"], factor)}


def _scaled(section: Any, factor: float) -> Any:  # noqa: ANN401
    if not isinstance(section, Mapping):
        return section
    return {
        key: value * factor if key in ("kp", "ki", "gain") and isinstance(value, float)
        else _scaled(value, factor)
        for key, value in section.items()
    }  # fmt: skip


def _without(tree: Tree, kind: str) -> Tree:
    rest = {name: event for name, event in tree["events"].items() if event["kind"] != kind}
    return {**tree, "events": rest}


_WORKED_OUT: Final[Mapping[str, Callable[[Tree, Any], Tree]]] = {
    "fuel": _fuel, "fuel_limit": _fuel_limit, "set_point_m": _set_point, "gains": _gains,
    "without": _without,
}  # fmt: skip
