"""The parameters by a configuration, and what a change of it means for the state."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, Final

from mypy_extensions import i64

from controller.mode.operation import Bounds
from controller.motion.choice import check, remade
from controller.motion.drive import Cycle
from controller.motion.law import Law
from controller.motion.maps.stroke_map import StrokeMap
from controller.observe.possible import possible_of
from controller.orders import with_law
from controller.state import Params, State
from controller.supervisory import Events, Supervisor
from controller.timing.valve_table import ValveTable
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.config.ranges import stale_ticks
from hil.errors import ConfigError
from hil.names.parameters import apply
from hil.values import NEVER, replace

_TDC: Final = "controller.tdc_ref_m"
_LAW: Final = "controller.name"
_POWER: Final = "controller.supervisory.target_power_w"
_LOAD: Final = "controller.supervisory.load_coefficient_n_s_m"
_THROTTLE: Final = "controller.supervisory.throttle"
_NONE: Final[Events] = ()


def limit_of(config: ControllerConfig, engine: Prototype) -> float:
    """Return the position beyond which no dead centre may be [m]."""
    limit_m = config.limits.tdc_m
    return engine.position_limit_m if limit_m is None else limit_m


def params_of(
    config: ControllerConfig, begun: ControllerConfig, engine: Prototype, period_ns: i64,
    stroke_map: StrokeMap | None, laws: Mapping[str, Law[Any]], table: ValveTable | None = None,
    cycle: Cycle | None = None,
) -> Params:  # fmt: skip
    """Put parameters together.

    Parameters: begun : with which the run began, and which the map and the preset belong to
    Raises: ConfigError when there is no such law, or it cannot work with the map
    """
    limits, fires, limit_m = config.limits, config.timing.fires, limit_of(config, engine)
    supervisor = Supervisor(config, engine, float(period_ns) * 1e-9, limit_m, begun)
    check(config.name, laws, stroke_map)
    bounds = Bounds(
        limit_m=limit_m,
        stale_ticks=stale_ticks(limits.stale_s, period_ns),
        misfires=limits.misfires,
        motoring_ns=round(config.start.timeout_s * 1e9) if any(fires) else NEVER,
        unheard_ns=round(limits.stale_s * 1e9),
    )
    is_simple = any(fires) and config.timing.spark_position_m is None
    most_n = config.start.force_n if is_simple else math.inf  # the gas moves the machine, too
    known = supervisor.performance
    possible = possible_of(
        engine, known.tdc_m, known.point(known.tdc_m, known.load_n_s_m).stroke_s, period_ns,
        limits.stale_s, all(fires), most_n,
    )  # fmt: skip
    return Params(
        config, begun, engine, period_ns, bounds, supervisor, stroke_map, dict(laws), possible,
        table, cycle,
    )  # fmt: skip


def retuned(params: Params, config: ControllerConfig) -> Params:
    """Return the parameters by another configuration.

    Engine and map stay those with which the run began.

    Raises: ConfigError when the law cannot work, or the set point is beyond what the limit allows
    """
    after = params_of(
        config, params.begun, params.engine, params.period_ns, params.stroke_map,
        remade(params.laws, config), params.valve_table, params.cycle,
    )  # fmt: skip
    most_m = after.bounds.limit_m - config.supervisory.tdc_room_m
    tdc_m = config.tdc_ref_m
    if tdc_m is not None and tdc_m > most_m:
        raise ConfigError(f"{_TDC} = {tdc_m:g}: accepted up to {most_m:g}, by limits.tdc_m")
    return after


def changed(params: Params, values: Mapping[str, object]) -> Params:
    """Return the parameters with other values, by their keys.

    Raises: ConfigError for what is not accepted
    """
    return retuned(params, apply(params.config, values))


def followed(params: Params, state: State, keys: Collection[str]) -> tuple[State, Events]:
    """Let the state follow keys that have changed: set points and law, which go on from it."""
    config, set_points, events = params.config, state.set_points, _NONE
    tdc_m = config.tdc_ref_m if _TDC in keys else None
    power_w = config.supervisory.target_power_w
    if tdc_m is not None or (_POWER in keys and power_w is not None):
        asked_w = power_w if _POWER in keys else None
        set_points, events = params.supervisor.changed(set_points, tdc_m, asked_w)
    if power_w is None and (_POWER in keys or _LOAD in keys):
        set_points = params.supervisor.released(set_points)
    throttle = config.supervisory.throttle if _THROTTLE in keys else set_points.throttle
    set_points = params.supervisor.throttled(set_points, throttle, 0.0)
    state = replace(state, set_points=set_points)
    return (with_law(params, state, config.name) if _LAW in keys else state), events
