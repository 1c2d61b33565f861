"""The controller as values: what is constant, what it remembers, what a tick takes and gives."""

from __future__ import annotations

import math
from typing import final

from controller.actuator import Machine
from controller.commands import OperatorCommand
from controller.mode.operation import Bounds, Operation
from controller.mode.start_restart import Mode
from controller.motion.fuelling import Fuelling
from controller.motion.law import Demand, View
from controller.motion.stroke_map import StrokeMap
from controller.observe.estimate import Motion, Passed
from controller.supervisory import SetPoints
from controller.timing.plan import Plan, PlannedPulse
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.values import Value
from hil.wire.messages import Message, PistonSample


@final
class Params(Value):
    """What does not change during a run."""

    __slots__ = ("config", "engine", "period_ns", "bounds", "full_load_n_s_m", "stroke_map")

    def __init__(
        self, config: ControllerConfig, engine: Prototype, period_ns: int, bounds: Bounds,
        full_load_n_s_m: float, stroke_map: StrokeMap | None,
    ) -> None:  # fmt: skip
        self.config = config
        self.engine = engine
        self.period_ns = period_ns
        self.bounds = bounds
        self.full_load_n_s_m = full_load_n_s_m
        self.stroke_map = stroke_map


@final
class State(Value):
    """Everything that the controller remembers from tick to tick, a value for each layer.

    stale: ticks in a row without a sample; pulses: those on the wire, not closed yet
    """

    __slots__ = ("motion", "stale", "operation", "set_points", "fuelling", "plan", "pulses")

    def __init__(
        self, motion: Motion, stale: int, operation: Operation, set_points: SetPoints,
        fuelling: Fuelling, plan: Plan, pulses: tuple[PlannedPulse, ...],
    ) -> None:  # fmt: skip
        self.motion = motion
        self.stale = stale
        self.operation = operation
        self.set_points = set_points
        self.fuelling = fuelling
        self.plan = plan
        self.pulses = pulses

    @property
    def mode(self) -> Mode:
        """The operating mode."""
        return self.operation.mode


@final
class Inputs(Value):
    """What comes in with a tick; `sample` is None when none that is valid came.

    power_w: electric power, nan when this tick's frames carried none
    """

    __slots__ = ("tick", "sample", "command", "power_w")

    def __init__(
        self, tick: int, sample: PistonSample | None, command: OperatorCommand | None = None,
        power_w: float = math.nan,
    ) -> None:  # fmt: skip
        self.tick = tick
        self.sample = sample
        self.command = command
        self.power_w = power_w


@final
class StrokeReport(Value):
    """One finished stroke, for the log."""

    __slots__ = ("number", "side", "tdc_m", "tdc_ref_m", "v_mid_m_s", "demand")

    def __init__(
        self, number: int, side: int, tdc_m: float, tdc_ref_m: float, v_mid_m_s: float,
        demand: Demand,
    ) -> None:  # fmt: skip
        self.number = number
        self.side = side
        self.tdc_m = tdc_m
        self.tdc_ref_m = tdc_ref_m
        self.v_mid_m_s = v_mid_m_s
        self.demand = demand


Events = tuple[tuple[str, str], ...]
"""(code, text) of each."""


@final
class Output(Value):
    """What goes out: the answer's messages, what they say in SI, and what the log should know."""

    __slots__ = ("messages", "machine", "throttle", "pulses", "stroke", "events", "may_fire")

    def __init__(
        self, messages: tuple[Message, ...], machine: Machine, throttle: float,
        pulses: tuple[PlannedPulse, ...], stroke: StrokeReport | None, events: Events,
        may_fire: bool,
    ) -> None:  # fmt: skip
        self.messages = messages
        self.machine = machine
        self.throttle = throttle
        self.pulses = pulses
        self.stroke = stroke
        self.events = events
        self.may_fire = may_fire


def view_of(
    params: Params, motion: Motion, passed: Passed, set_points: SetPoints, fuelling: Fuelling,
    power_w: float,
) -> View:  # fmt: skip
    """One tick as a law sees it."""
    limits = params.config.limits
    return View(
        dt_s=params.period_ns * 1e-9,
        motion=motion,
        passed=passed,
        tdc_ref_m=set_points.tdc_ref_m,
        load_n_s_m=set_points.load_n_s_m,
        point=set_points.point,
        power_w=power_w,
        burnt_kg=fuelling.burnt_kg,
        fuel_min_kg=limits.fuel_min_kg,
        fuel_max_kg=limits.fuel_max_kg * set_points.throttle,
        stroke_map=params.stroke_map,
    )
