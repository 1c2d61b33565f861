"""Level 3 within a stroke: what a law that watches every tick wants changed, and its hand-over."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from controller import safety, timing
from controller.actuator import Machine
from controller.estimate import Motion, Passed, seconds_to_dead_centre
from controller.laws import LAWS
from controller.laws.engine_map import EngineMap, at, calibrate, path, travel
from controller.laws.interface import Demand, Handover, TickFacts, Watch
from controller.supervisory import SetPoints, initial
from controller.timing import Plan
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.errors import ConfigError


class Trimmed(NamedTuple):
    """What a tick leaves: the law's state, its demand, the plan, and what the machine is to do."""

    law: Any
    demand: Demand
    plan: Plan
    machine: Machine


def model_of(config: ControllerConfig, engine: Prototype) -> EngineMap | None:
    """What the laws may believe of a stroke, from the steady state at the start."""
    start = initial(config, engine)
    return calibrate(engine, start.tdc_ref_m, start.load_n_s_m, start.point)


def refusal(name: str, model: EngineMap | None) -> str:
    """Tell why a law cannot work; an empty string when it can."""
    if LAWS[name].needs_model and model is None:
        return f"controller {name}: the preset is no steady state from which a stroke can be told"
    if LAWS[name].needs_fit and model is not None and not model.fits:
        return (
            f"controller {name}: follows the force within a stroke, and the preset is the steady"
            " state of an engine of another kind (accepted: harmonic, rectangular)"
        )
    return ""


def check(config: ControllerConfig, model: EngineMap | None) -> None:
    """Refuse a configuration whose law cannot work.

    Raises: ConfigError
    """
    reason = refusal(config.name, model)
    if reason:
        raise ConfigError(reason)


def hand_over(
    config: ControllerConfig,
    name: str,
    motion: Motion,
    set_points: SetPoints,
    burnt_kg: tuple[float, float],
) -> Any:  # noqa: ANN401
    """The state with which another law goes on, so that the fuel does not jump."""
    facts = Handover(
        set_points.tdc_ref_m, motion.tdc_m, motion.v_mid_m_s, set_points.point, burnt_kg
    )
    return LAWS[name].taken_over(config, facts)


def seconds_ahead(
    model: EngineMap, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float],
    period_ns: int,
) -> float:  # fmt: skip
    """Time from the newest sample to the dead centre ahead [s].

    By the stroke's own map; that of a free oscillation where the engine is of another kind.
    """
    if not model.fits:
        return seconds_to_dead_centre(motion, period_ns * 1e-9, math.pi / model.stroke_s)
    direction = motion.direction
    tau = (motion.t_ns - motion.dc_t_ns) * 1e-9
    z, v = direction * motion.x_m, direction * motion.v_m_s
    return travel(model, burnt_kg[motion.side], load_n_s_m, z, v, tau)[1]


def speeds(
    model: EngineMap, motion: Motion, load_n_s_m: float, fuel_kg: float
) -> tuple[float, float]:
    """Speeds that the piston should have by now: with the charge burnt, and with none [m/s]."""
    tau = (motion.t_ns - motion.dc_t_ns) * 1e-9
    fired, unfired = (
        at(path(model, q, load_n_s_m, -motion.tdc_m, 0.0, 0.0), tau)[1] for q in (fuel_kg, 0.0)
    )
    return fired, unfired


def ahead_by(
    model: EngineMap | None, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float],
    period_ns: int,
) -> Callable[[], float] | None:  # fmt: skip
    """The same, to be called if it is needed; None without a map.

    After a stroke that did not fire, and while motoring, it is the stroke of the air springs.
    """
    if model is None or not model.fits:
        return None
    return lambda: seconds_ahead(model, motion, load_n_s_m, burnt_kg, period_ns)


def trim(
    config: ControllerConfig, model: EngineMap, watch: Watch, law: Any, demand: Demand,  # noqa: ANN401
    plan: Plan, machine: Machine, *, motion: Motion, passed: Passed, set_points: SetPoints,
    burnt_kg: tuple[float, float], power_w: float, t_ns: int, period_ns: int,
) -> Trimmed:  # fmt: skip
    """Let a law watch one tick, and retime the injection that is still to be trimmed."""
    throttle = set_points.throttle
    facts = TickFacts(
        period_ns * 1e-9, motion, passed, (t_ns - motion.dc_t_ns) * 1e-9, set_points.tdc_ref_m,
        set_points.load_n_s_m, power_w, plan.fuel_kg, burnt_kg, config.limits.fuel_min_kg,
        config.limits.fuel_max_kg * throttle, model,
    )  # fmt: skip
    law, wish = watch(config, law, facts)
    if wish.fuel_kg is not None and plan.fuel_kg > 0.0:
        wanted = demand._replace(fuel_kg=wish.fuel_kg)
        demand = safety.limit_fuel(config.limits, throttle, wanted)
    if plan.injection is not None and plan.injection.close_ns > t_ns:
        ahead_s = seconds_ahead(model, motion, set_points.load_n_s_m, burnt_kg, period_ns)
        dead_centre_ns = motion.t_ns + round(ahead_s * 1e9)
        plan = timing.retime_injection(
            config, plan, dead_centre_ns, t_ns, period_ns, demand.fuel_kg
        )
    if wish.load_n_s_m is not None:
        machine = machine._replace(load_n_s_m=wish.load_n_s_m)
    return Trimmed(law, demand, plan, machine)
