"""What a run with port injection is filled in with, and what cannot have one."""

from __future__ import annotations

import math
from typing import Any

from hil.config.scenario import Scenario
from hil.errors import ConfigError

_OF_THE_PORT = ("kind", "film_share", "film_time_s")


def fill(scenario: Scenario, tree: dict[str, Any]) -> None:
    """Let the controller know the plant's kind of injection, and both begin with a settled film.

    Parameters: tree : the scenario with all else filled in
    Raises: ConfigError for what cannot be injected into a port, or is believed to be
    """
    plant, known = tree["plant"]["injector"], tree["controller"]["injector"]
    given = scenario.controller.injector.model_fields_set
    for key in {*_OF_THE_PORT, "intake_closes_m"} - given:
        known[key] = plant[key]
    if known["kind"] != plant["kind"]:
        raise ConfigError(
            f"{scenario.name}: controller.injector.kind = {known['kind']!r}: the plant injects"
            f" otherwise, and would burn each mass a stroke away; accepted: {plant['kind']}"
        )
    if plant["kind"] == "direct":
        return
    if not all(tree["controller"]["timing"]["fires"]):
        raise ConfigError(
            f"{scenario.name}: plant.injector.kind = 'port': model {scenario.plant.model} has"
            " strokes that do not fire, and no intake that closes in each; accepted: direct"
        )
    if scenario.begins == "settled":
        for section in (plant, known):
            if section["film_kg"] is None:
                section["film_kg"] = settled_film_kg(section, tree["controller"])


def settled_film_kg(injector: dict[str, Any], controller: dict[str, Any]) -> float:
    """Return the film as an intake closes, of a settled motion on its preset fuel.

    F = X b m / (1 - a)     (controller/timing/port.py), with the injection as late as is safe
    """
    preset, timing = controller["preset"], controller["timing"]
    stroke_s, tdc_m = preset["stroke_s"], controller["tdc_ref_m"]
    before_s = timing["injection_margin_s"] + 0.05 * stroke_s
    before_s += 0.5 * preset["fuel_kg"] / injector["static_flow_kg_s"]
    a = math.exp(-2.0 * stroke_s / injector["film_time_s"])
    b = math.exp(-before_s / injector["film_time_s"])
    return float(injector["film_share"] * b * preset["fuel_kg"] / (1.0 - a))
