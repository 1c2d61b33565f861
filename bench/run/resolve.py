"""Filling in what a scenario leaves open, so that its record alone says what was run."""

from __future__ import annotations

from functools import lru_cache, reduce
from pathlib import Path
from typing import Any

from bench.run.checks.protection import check_protection
from bench.run.checks.signals import check_expectations
from bench.run.checks.stimuli import check_stimuli, loaded
from bench.run.filling import detailed, fmu, ignition, own, port
from bench.run.filling.start_load import start_load
from bench.run.sensitivities import believing
from controller.knowledge import load_for_power
from controller.motion.choice import check_names
from controller.motion.own import own_settings, own_source
from controller.supervision.performance import Performance, Steady
from controller.supervisory import Supervisor
from controller.timing import budget
from hil.config.check import check
from hil.config.controller import ControllerConfig
from hil.config.plant import AirConfig
from hil.config.prototypes import Prototype
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.config.supervisory.air import AirKnowledge
from hil.errors import ConfigError
from hil.names.own import checked
from plant.engines.fast.constants import Constants, constants_of
from plant.engines.fast.limit_cycle import LimitCycle, fuel_for_tdc, limit_cycle, steady_at
from plant.engines.fast.limit_cycle import power_w as settled_power_w
from plant.rig import disturbances

_SLOPE_STEP = 0.01
_OF_THE_MOTION = ("v_mid_m_s", "stroke_s", "fuel_per_speed_kg_s_m", "power_w")

_OF_THE_ENGINE = {
    "plant": {"contact_restitution": "contact_restitution"},
    "plant.injector": {
        "static_flow_kg_s": "injector_kg_s",
        "dead_time_s": "injector_dead_s",
        "intake_closes_m": "intake_closes_m",
    },
    "controller.injector": {"static_flow_kg_s": "injector_kg_s", "dead_time_s": "injector_dead_s"},
    "controller.start": {"force_n": "start_force_n"},
    "controller.limits": {"fuel_min_kg": "fuel_min_kg", "fuel_max_kg": "fuel_max_kg"},
}
"""By section and key which figure of the engine a run has unless it is given."""

_MAP_OF_MODEL = {"harmonic": "linear", "rectangular": "linear", "nonlinear": "gas-law"}
"""By the plant's model which stroke map the laws are given unless one is named."""

# The non-linear model is integrated for every fuel that is tried.
_fuel_for_tdc = lru_cache(maxsize=8)(fuel_for_tdc)


def resolve(scenario: Scenario, sockets: Path | None = None) -> Resolved:
    """Return the scenario with set point, loads, limits, preset and endpoints all given.

    Parameters: sockets : directory for the Zenoh sockets of this run, with a short path; None
        leaves the endpoints as they are
    Raises: ConfigError when the run cannot begin settled as it was asked to
    """
    check_expectations(scenario)
    found = _resolved(loaded(scenario), sockets)
    _check_set_point(found)
    whole = believing(found)
    check_stimuli(whole)
    check_protection(whole)
    _check_disturbances(whole)
    return whole


def _check_disturbances(scenario: Resolved) -> None:
    """Refuse what would disturb nothing on this plant.

    Raises: ConfigError
    """
    if reason := disturbances.objection(scenario.plant):
        raise ConfigError(f"{scenario.name}: {reason}")
    for name, event in scenario.events.items():
        if reason := disturbances.objection_to(scenario.plant, event.kind):
            raise ConfigError(f"{scenario.name}: events.{name}: {reason}")


def _check_set_point(scenario: Resolved) -> None:
    """Refuse a set point that leaves no room to the limit of position, as an operator's is.

    Raises: ConfigError
    """
    c = scenario.controller
    most_m = c.limits.tdc_m - c.supervisory.tdc_room_m
    if c.name != "open-loop" and c.tdc_ref_m > most_m:
        raise ConfigError(
            f"{scenario.name}: controller.tdc_ref_m = {c.tdc_ref_m:g}: accepted up to {most_m:g},"
            f" {c.supervisory.tdc_room_m:g} below the limit of position"
        )


def _resolved(scenario: Scenario, sockets: Path | None) -> Resolved:
    """All of it but what is found by running the engine.

    Raises: ConfigError
    """
    if fmu.is_unit(scenario):
        return fmu.fill(scenario, lambda like: _resolved(like, sockets))
    if own.is_own(scenario):
        return own.fill(scenario, lambda like: _resolved(like, sockets))
    check_names(scenario)
    if scenario.plant.model == "closed-form" and scenario.controller.name == "machine":
        raise ConfigError(
            f"{scenario.name}: controller machine: the closed-form model takes its load at the dead"
            " centres only; accepted there are the other controllers"
        )
    tree = scenario.model_dump()
    tree["plant"]["prototype"] = detailed.prototype_of(scenario)
    engine = scenario.plant.model_copy(update={"prototype": tree["plant"]["prototype"]})
    _fill_figures(scenario, engine.believed(), tree)
    if detailed.is_detailed(scenario):
        detailed.fill(scenario, tree)
    elif scenario.controller.timing.valves == "controller":
        raise detailed.no_valves(scenario, f"model {scenario.plant.model}")
    else:
        prototype = scenario.plant.resolved_prototype()
        tree["plant"]["load_coefficient_n_s_m"] = prototype.load_coefficient_n_s_m
        _fill_controller(scenario, prototype, tree["controller"])
    tree["controller"]["own"] = _own(scenario)
    budget.fit(scenario, tree)
    port.fill(scenario, tree)
    ignition.fill(scenario, tree)
    if sockets is not None:
        _fill_endpoints(scenario, sockets, tree["link"]["zenoh"])
    return check(Resolved, tree, scenario.name)


def _own(scenario: Scenario) -> dict[str, Any]:
    """Return the law that the user has brought with its hash, place and whole settings.

    Raises: ConfigError when it cannot be the law of this run
    """
    given, source = scenario.controller.own, own_source(scenario.controller)
    if source is None:
        return given.model_dump()
    kind, brought = source
    settings = own_settings(kind, scenario.controller, brought)
    return {
        "name": given.name or scenario.controller.name,
        "file": given.file and str(brought.path.resolve()),
        "sha256": brought.sha256,
        "settings": {} if settings is None else settings.model_dump(),
        "signals": checked(getattr(kind, "signals", {}), str(brought.path)),
    }


def _fill_figures(scenario: Scenario, prototype: Prototype, tree: dict[str, Any]) -> None:
    """Give the engine's own figures, each unless the scenario has it."""
    for path, figures in _OF_THE_ENGINE.items():
        keys = path.split(".")
        given: Any = reduce(getattr, keys, scenario)
        section = reduce(dict.__getitem__, keys, tree)
        for key in figures.keys() - given.model_fields_set:
            section[key] = getattr(prototype, figures[key])
    given_air = scenario.controller.air.model_fields_set
    for key in AirConfig.model_fields.keys() & AirKnowledge.model_fields.keys() - given_air:
        tree["controller"]["air"][key] = getattr(scenario.plant.air, key)


def _fill_controller(scenario: Scenario, prototype: Prototype, tree: dict[str, Any]) -> None:
    """Give set point, limit, loads and preset, each unless the scenario has it."""
    given = scenario.controller
    tdc_m = given.tdc_ref_m if given.tdc_ref_m is not None else prototype.tdc_ref_m
    chosen = given.supervisory.choice == "efficiency" and given.tdc_ref_m is None
    if chosen and given.supervisory.target_power_w is not None:
        known = Performance(given, prototype, scenario.loop.period_ns * 1e-9)
        tdc_m = known.best(given.supervisory.target_power_w)[0]
    tree["tdc_ref_m"] = tdc_m
    supervisory = given.supervisory
    if supervisory.load_coefficient_n_s_m is None:
        tree["supervisory"]["load_coefficient_n_s_m"] = prototype.load_coefficient_n_s_m
    if given.limits.tdc_m is None:
        tree["limits"]["tdc_m"] = prototype.position_limit_m
    if "fuel_max_kg" not in given.limits.model_fields_set:
        tree["limits"]["fuel_max_kg"] = prototype.fuel_max_kg
    if given.stroke_map.kind == "auto":
        tree["stroke_map"]["kind"] = _MAP_OF_MODEL.get(scenario.plant.model, "auto")
    engine = constants_of(prototype, scenario.plant.model)
    load = tree["supervisory"]["load_coefficient_n_s_m"]
    if supervisory.target_power_w is not None and tree["preset"]["load_coefficient_n_s_m"] is None:
        filled = check(ControllerConfig, tree, scenario.name)
        load, limit = _start_load(filled, prototype, engine, scenario.loop.period_ns * 1e-9)
        tree["preset"] |= {"load_coefficient_n_s_m": load, "limit": limit}
    if given.open_loop.fuel_kg is None:
        tree["open_loop"]["fuel_kg"] = prototype.fixed_fuel_kg
    _fill_preset(scenario, tree, engine, load)
    _fill_throttle(scenario, prototype, tree)


def _fill_throttle(scenario: Scenario, prototype: Prototype, tree: dict[str, Any]) -> None:
    """Begin at the opening that the controller will choose, where it chooses one."""
    filled = check(ControllerConfig, tree, scenario.name)
    supervisor = Supervisor(
        filled, prototype, scenario.loop.period_ns * 1e-9, tree["limits"]["tdc_m"]
    )
    tree["supervisory"]["throttle"] = supervisor.initial().throttle


def _start_load(
    given: ControllerConfig, prototype: Prototype, engine: Constants, period_s: float
) -> tuple[float, str]:
    """Return the load with which the engine's own model delivers the target power [N s/m]."""
    tdc_m, power_w = given.tdc_ref_m, given.supervisory.target_power_w
    assert tdc_m is not None
    assert power_w is not None

    def at(load: float) -> Steady:
        fuel_kg, cycle = steady_at(engine, tdc_m, load)
        stroke_s, here_w = 0.5 / cycle.frequency_hz, settled_power_w(engine, fuel_kg, cycle)
        return Steady(fuel_kg, cycle.v_mid_m_s, stroke_s, here_w)

    guess = load_for_power(prototype, tdc_m, max(power_w, 1.0))
    reach = start_load(given, prototype, period_s, guess, at)
    return reach.load_n_s_m, reach.limit


def _fill_preset(scenario: Scenario, tree: dict[str, Any], engine: Constants, load: float) -> None:
    """Give the settled motion that the run begins with, or that the laws work about."""
    preset = tree["preset"]
    fuel_kg = preset["fuel_kg"]
    if fuel_kg is None and tree["name"] == "open-loop":
        fuel_kg = _settling_fuel(engine, tree["open_loop"]["fuel_kg"], load)
    if fuel_kg is None:
        fuel_kg = _fuel_for_tdc(engine, tree["tdc_ref_m"], load)
    preset["fuel_kg"] = fuel_kg
    if all(preset[key] is not None for key in _OF_THE_MOTION):
        return
    settled = _settled(scenario, engine, fuel_kg, load)
    if preset["v_mid_m_s"] is None:
        preset["v_mid_m_s"] = settled.v_mid_m_s
    if preset["stroke_s"] is None:
        preset["stroke_s"] = 0.5 / settled.frequency_hz
    if preset["power_w"] is None:
        preset["power_w"] = settled_power_w(engine, fuel_kg, settled)
    if preset["fuel_per_speed_kg_s_m"] is None:
        preset["fuel_per_speed_kg_s_m"] = _fuel_per_speed(engine, fuel_kg, load)


def _settling_fuel(engine: Constants, fuel_kg: float, load: float) -> float | None:
    """Return the fuel if the engine settles on it inside its stroke, else None.

    An open-loop run on any other fuel begins at the set point and goes where that fuel takes it.
    """
    try:
        inside = limit_cycle(engine, fuel_kg, load).tdc_m < engine.contact_m
    except ConfigError:
        return None
    return fuel_kg if inside else None


def _fuel_per_speed(engine: Constants, fuel_kg: float, load: float) -> float:
    """Return the slope of the settled fuel over the settled mid-stroke speed [kg s/m]."""
    step_kg = _SLOPE_STEP * fuel_kg
    faster = limit_cycle(engine, fuel_kg + step_kg, load).v_mid_m_s
    slower = limit_cycle(engine, fuel_kg - step_kg, load).v_mid_m_s
    return 2.0 * step_kg / (faster - slower)


def _settled(scenario: Scenario, engine: Constants, fuel_kg: float, load: float) -> LimitCycle:
    """Return the settled motion on that fuel; a run that begins in it must not strike a head."""
    cycle = limit_cycle(engine, fuel_kg, load)
    if scenario.begins == "settled" and cycle.tdc_m >= engine.contact_m:
        raise ConfigError(
            f"{scenario.name}: cannot begin settled: {fuel_kg * 1e6:.4g} mg at {load:g} N s/m "
            f"reach {cycle.tdc_m * 1e3:.2f} mm, the head is at {engine.contact_m * 1e3:g} mm"
        )
    return cycle


def _fill_endpoints(scenario: Scenario, sockets: Path, tree: dict[str, Any]) -> None:
    """Let the processes of this run meet on sockets of their own, unless endpoints are given."""
    given = scenario.link.zenoh.model_fields_set
    for side in ("plant", "controller"):
        if f"{side}_endpoint" not in given:
            tree[f"{side}_endpoint"] = f"unixsock-stream/{sockets / f'{side}.sock'}"
