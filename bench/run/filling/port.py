"""What a run with port injection is filled in with, and what cannot have one."""

from __future__ import annotations

import math
from typing import Any

from controller.timing.port import Port
from hil.config.charge.injection import InjectorKnowledge, Injectors
from hil.config.scenario import Scenario
from hil.errors import ConfigError

_OF_THE_PORT = ("kind", "film_share", "film_time_s", "intake_closes_m")
_GAINS: dict[str, Any] = {
    "cascade": {
        "outer": {"kp": 20.9, "ki": 22.5, "kd": 0.0},
        "inner": {"kp": 0.991e-6, "ki": 0.581e-6, "kd": 0.0},
    },
    "single_loop": {"tdc": {"kp": 0.8e-4, "ki": 0.45e-4, "kd": 2.0e-5}},
}
"""Gains of the laws that wait a stroke longer for what they ask; found as docs/tuning.md says."""


def fill(scenario: Scenario, tree: dict[str, Any]) -> None:
    """Let the controller know the plant's kind of injection, and both begin with a settled film.

    Parameters: tree : the scenario with all else filled in
    Raises: ConfigError for what cannot be injected into a port, or is believed to be
    """
    plant, known = tree["plant"]["injector"], tree["controller"]["injector"]
    given = scenario.controller.injector.model_fields_set
    for key in set(_OF_THE_PORT) - given:
        known[key] = plant[key]
    if known["kind"] != plant["kind"]:
        raise ConfigError(
            f"{scenario.name}: controller.injector.kind = {known['kind']!r}: the plant injects"
            f" otherwise, and would burn each mass a stroke away; accepted: {plant['kind']}"
        )
    if plant["kind"] == "port":
        _fill_port(scenario, tree, plant, known)


def _fill_port(
    scenario: Scenario, tree: dict[str, Any], plant: dict[str, Any], known: dict[str, Any]
) -> None:
    """Give gains and films, where every stroke has an intake that closes.

    Raises: ConfigError where not
    """
    if not all(tree["controller"]["timing"]["fires"]):
        raise ConfigError(
            f"{scenario.name}: plant.injector.kind = 'port': model {scenario.plant.model} has"
            " strokes that do not fire, and no intake that closes in each; accepted: direct"
        )
    for law in _GAINS.keys() - scenario.controller.model_fields_set:
        tree["controller"][law] |= _GAINS[law]
    if scenario.begins == "settled":
        half_m = scenario.plant.resolved_prototype().half_stroke_m
        for section in (plant, known):
            if section["film_kg"] is None:
                section["film_kg"] = settled_film_kg(section, tree["controller"], half_m)


def settled_film_kg(
    injector: dict[str, Any], controller: dict[str, Any], half_stroke_m: float
) -> float:
    """Return the film as an intake closes, of a settled motion on its preset fuel.

    F = X b m / (1 - a)     (controller/timing/port.py), with the injection as late as is safe
    """
    preset, timing = controller["preset"], controller["timing"]
    stroke_s = preset["stroke_s"]
    believed = Port(InjectorKnowledge.model_validate(_common(injector)), half_stroke_m)
    before_s = 1e-9 * float(believed.closes_ns(controller["tdc_ref_m"], stroke_s))
    before_s += timing["injection_margin_s"] + 0.05 * stroke_s
    before_s += 0.5 * preset["fuel_kg"] / injector["static_flow_kg_s"]
    a = math.exp(-2.0 * stroke_s / injector["film_time_s"])
    b = math.exp(-before_s / injector["film_time_s"])
    return float(injector["film_share"] * b * preset["fuel_kg"] / (1.0 - a))


def _common(injector: dict[str, Any]) -> dict[str, Any]:
    """What the plant's injectors and the controller's knowledge of them have in common."""
    return {key: injector[key] for key in Injectors.model_fields}
