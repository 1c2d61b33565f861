"""The controller as values: what is constant, what it remembers, what a tick takes and gives."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controller import supervisory, trimming
from controller.actuator import Machine
from controller.commands import OperatorCommand
from controller.estimate import Motion
from controller.laws import LAWS
from controller.laws.engine_map import EngineMap
from controller.laws.interface import NO_DEMAND, Demand, Law
from controller.start_restart import Mode
from controller.supervisory import SetPoints
from controller.timing import NO_PLAN, Plan, PlannedPulse
from hil.config.controller import ControllerConfig
from hil.config.prototypes import PROTOTYPES, Prototype
from hil.wire.messages import Message, PistonSample

NEVER_NS = 1 << 62
"""Longer than any run."""


class Params(NamedTuple):
    """What does not change during a run."""

    config: ControllerConfig
    engine: Prototype
    law: Law
    period_ns: int
    limit_m: float
    full_load_n_s_m: float
    motoring_limit_ns: int
    model: EngineMap | None


class State(NamedTuple):
    """Everything that the controller remembers from tick to tick.

    law_name: the law in force, whose state is `law`
    burnt_kg: fuel planned for the last dead centre at the left and at the right head
    beyond_kg: what the law has been asking for beyond the steady fuel, averaged over some strokes
    """

    mode: Mode
    motion: Motion
    set_points: SetPoints
    law: Any
    demand: Demand
    plan: Plan
    pulses: tuple[PlannedPulse, ...]
    stale: int
    misfires: int
    fired_t_ns: int
    fired_strokes: int
    since_t_ns: int
    law_name: str
    burnt_kg: tuple[float, float]
    beyond_kg: float


class Inputs(NamedTuple):
    """What comes in with a tick; `sample` is None when none that is valid came.

    power_w: electric power, nan when this tick's frames carried none
    """

    tick: int
    sample: PistonSample | None
    command: OperatorCommand | None = None
    power_w: float = math.nan


class StrokeReport(NamedTuple):
    """One finished stroke, for the log."""

    number: int
    side: int
    tdc_m: float
    tdc_ref_m: float
    v_mid_m_s: float
    demand: Demand


class Output(NamedTuple):
    """What goes out: the answer's messages, what they say in SI, and what the log should know."""

    messages: tuple[Message, ...]
    machine: Machine
    throttle: float
    pulses: tuple[PlannedPulse, ...]
    stroke: StrokeReport | None
    events: tuple[tuple[str, str], ...]
    may_fire: bool


def make_params(config: ControllerConfig, prototype: str, period_ns: int) -> Params:
    """Resolve a configuration for a prototype and a tick.

    Raises: ConfigError when the law cannot work with it
    """
    engine = PROTOTYPES[prototype]
    limit = engine.position_limit_m if config.limits.tdc_m is None else config.limits.tdc_m
    full = supervisory.full_load(config, engine)
    motoring_limit_ns = (
        round(config.start.timeout_s * 1e9) if any(config.timing.fires) else NEVER_NS
    )
    model = trimming.model_of(config, engine)
    trimming.check(config, model)
    law = LAWS[config.name]
    return Params(config, engine, law, period_ns, limit, full, motoring_limit_ns, model)


def initial_mode(config: ControllerConfig) -> Mode:
    """The mode in which a run begins; an engine of which no stroke fires is motored throughout."""
    if not config.running:
        return Mode.OFF
    return Mode.GENERATING if any(config.timing.fires) else Mode.MOTORING


def initial_state(params: Params) -> State:
    """The state before the first tick: running in the steady state, or off."""
    set_points = supervisory.initial(params.config, params.engine)
    mode = initial_mode(params.config)
    motion = Motion(tdc_m=set_points.tdc_ref_m)
    return State(
        mode, motion, set_points, params.law.initial, NO_DEMAND, NO_PLAN, (),
        0, 0, -1, params.config.start.open_strokes, 0, params.law.name,
        (set_points.point.fuel_kg, set_points.point.fuel_kg), 0.0,
    )  # fmt: skip
