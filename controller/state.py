"""The controller as values: what is constant, what it remembers, what a tick takes and gives."""

from __future__ import annotations

import math
from typing import Any, final

from mypy_extensions import i64

from controller.actuator import Machine
from controller.mode.operation import Bounds, Operation
from controller.mode.start_restart import Mode
from controller.motion.drive import AT_REST, Cycle, Drive
from controller.motion.fuelling import Fuelling
from controller.motion.law import Demand, Law, View
from controller.motion.maps.stroke_map import StrokeMap
from controller.observe.estimate import Motion, Passed
from controller.observe.possible import Possible
from controller.observe.power import UNMETERED, Metering
from controller.safety import Limits
from controller.supervision.protection import UNTOUCHED, CycleReport, Guard, Protection
from controller.supervisory import Events, SetPoints, Supervisor
from controller.timing.plan import NO_PLAN, Plan, PlannedPulse, Timings
from controller.timing.port import Film, Port
from controller.timing.valve_table import ValveTable
from controller.timing.valves import ValveTiming
from hil.config.controller import ControllerConfig, StartConfig
from hil.config.prototypes import Prototype
from hil.values import Value
from hil.wire.commands import OperatorCommand
from hil.wire.messages import CylinderPeak, PistonSample, ValveMove
from hil.wire.pulses import may_fire


@final
class Start:
    """Section `start` of the configuration, read once for all ticks."""

    def __init__(self, config: StartConfig) -> None:
        self.force_n = config.force_n
        self.constant_force = config.constant_force
        self.amplitude_ratio = config.amplitude_ratio
        self.ignition_ratio = config.ignition_ratio
        self.open_strokes: i64 = config.open_strokes


@final
class Params:
    """What does not change within a tick.

    config: in force; begun: with which the run began
    laws: all that there are, by name; the one that is configured is at hand as `law`
    port: the intake ports that the injectors feed, None where they feed the cylinders
    valve_table: where valves are to move, None where the controller does not move them
    cycle: the machine's part in a four-stroke cycle, None where the controller does not drive it
    """

    def __init__(
        self, config: ControllerConfig, begun: ControllerConfig, engine: Prototype, period_ns: i64,
        bounds: Bounds, supervisor: Supervisor, stroke_map: StrokeMap | None,
        laws: dict[str, Law[Any]], possible: Possible, valve_table: ValveTable | None = None,
        cycle: Cycle | None = None,
    ) -> None:  # fmt: skip
        self.config = config
        self.begun = begun
        self.engine = engine
        self.period_ns = period_ns
        self.dt_s = float(period_ns) * 1e-9
        self.bounds = bounds
        self.supervisor = supervisor
        self.stroke_map = stroke_map
        self.possible = possible
        self.valve_table = valve_table
        self.cycle = cycle
        self.limits = Limits(config.limits)
        self.start = Start(config.start)
        self.timings = Timings(config)
        injector, half_m = config.injector, engine.half_stroke_m
        self.port = Port(injector, half_m) if injector.kind == "port" else None
        self.guard = Guard(config, engine)
        self.laws = laws
        self.law_name: str = config.name
        self.law = laws[config.name]

    def law_of(self, name: str) -> Law[Any]:
        """The law of that name."""
        return self.law if name == self.law_name else self.laws[name]


@final
class State(Value):
    """Everything that the controller remembers from tick to tick, a value for each layer.

    stale: ticks in a row without a sample; pulses: those on the wire, not closed yet
    ahead: what is ordered for the dead centre ahead until the law has been asked
    valves: None where the controller does not move them; film: of intake ports, None without
    """

    __slots__ = (
        "motion", "stale", "operation", "set_points", "fuelling", "plan", "pulses", "ahead",
        "valves", "metering", "drive", "film", "protection",
    )  # fmt: skip

    def __init__(
        self, motion: Motion, stale: i64, operation: Operation, set_points: SetPoints,
        fuelling: Fuelling, plan: Plan, pulses: tuple[PlannedPulse, ...], ahead: Plan = NO_PLAN,
        valves: ValveTiming | None = None, metering: Metering = UNMETERED, drive: Drive = AT_REST,
        film: Film | None = None,
        protection: Protection = UNTOUCHED,
    ) -> None:  # fmt: skip
        self.motion = motion
        self.stale = stale
        self.operation = operation
        self.set_points = set_points
        self.fuelling = fuelling
        self.plan = plan
        self.pulses = pulses
        self.ahead = ahead
        self.valves = valves
        self.metering = metering
        self.drive = drive
        self.film = film
        self.protection = protection

    @property
    def in_force(self) -> Plan:
        """The plan for the dead centre ahead: the law's, or what was ordered long before."""
        return self.plan if self.plan.is_set else self.ahead

    @property
    def mode(self) -> Mode:
        """The operating mode."""
        return self.operation.mode


@final
class Inputs(Value):
    """What comes in with a tick; `sample` is None when none that is valid came.

    power_w: electric power, nan when this tick's frames carried none
    fault: what the samples show to be wrong, by its number in controller/observe/plausibility.py
    told: what a valve's position switch, or the indicator of a cylinder, has told
    winding_k: temperature of the winding, nan when this tick's frames carried none
    """

    __slots__ = ("tick", "sample", "command", "power_w", "fault", "told", "winding_k")

    def __init__(
        self, tick: i64, sample: PistonSample | None, command: OperatorCommand | None = None,
        power_w: float = math.nan, fault: i64 = 0, told: ValveMove | CylinderPeak | None = None,
        winding_k: float = math.nan,
    ) -> None:  # fmt: skip
        self.tick = tick
        self.sample = sample
        self.command = command
        self.power_w = power_w
        self.fault = fault
        self.told = told
        self.winding_k = winding_k


@final
class StrokeReport(Value):
    """One finished stroke, for the log; what is not known is None."""

    __slots__ = (
        "number", "side", "tdc_m", "tdc_ref_m", "v_mid_m_s", "demand", "speed_hz", "power_w",
        "power_ref_w", "lambda_ratio",
    )  # fmt: skip

    def __init__(
        self, number: i64, side: i64, tdc_m: float, tdc_ref_m: float, v_mid_m_s: float,
        demand: Demand, speed_hz: float | None = None, power_w: float | None = None,
        power_ref_w: float | None = None, lambda_ratio: float | None = None,
    ) -> None:  # fmt: skip
        self.number = number
        self.side = side
        self.tdc_m = tdc_m
        self.tdc_ref_m = tdc_ref_m
        self.v_mid_m_s = v_mid_m_s
        self.demand = demand
        self.speed_hz = speed_hz
        self.power_w = power_w
        self.power_ref_w = power_ref_w
        self.lambda_ratio = lambda_ratio


@final
class Output(Value):
    """What goes out, and what the log should know."""

    __slots__ = ("mode", "machine", "throttle", "pulses", "stroke", "events", "cycle")

    def __init__(
        self, mode: Mode, machine: Machine, throttle: float, pulses: tuple[PlannedPulse, ...],
        stroke: StrokeReport | None, events: Events, cycle: CycleReport | None = None,
    ) -> None:  # fmt: skip
        self.mode = mode
        self.machine = machine
        self.throttle = throttle
        self.pulses = pulses
        self.stroke = stroke
        self.events = events
        self.cycle = cycle

    @property
    def may_fire(self) -> bool:
        """Whether a line may be high in this mode."""
        return may_fire(self.mode)


def view_of(
    params: Params, motion: Motion, passed: Passed, set_points: SetPoints, fuelling: Fuelling,
    power_w: float, enclosed_kg: float = 0.0,
) -> View:  # fmt: skip
    """One tick as a law sees it; `enclosed_kg` burns at the dead centre ahead, come what may."""
    limits = params.limits
    return View(
        params.dt_s, motion, passed, set_points.tdc_ref_m, set_points.load_n_s_m, set_points.point,
        power_w, fuelling.burnt_kg, limits.fuel_min_kg, set_points.most_kg,
        params.stroke_map, 0 if params.port is None else 1, enclosed_kg,
    )  # fmt: skip


def report_of(
    params: Params, state: State, motion: Motion, set_points: SetPoints, power_w: float | None
) -> StrokeReport | None:
    """The stroke that has ended, if it was one to end in a combustion."""
    if not params.timings.fire(motion.stroke - 1):
        return None
    begun_ns, target = state.motion.dc_t_ns, set_points.target
    lasted_s = float(motion.dc_t_ns - begun_ns) * 1e-9
    demand, air = state.fuelling.demand, params.supervisor.air
    if params.port is not None:  # what was asked for in the stroke before burns now
        demand = demand.of(state.in_force.fuel_kg)
    fuel_kg = demand.fuel_kg
    lambda_ratio = air.lambda_of(set_points.manifold_pa, fuel_kg) if fuel_kg > 0.0 else None
    return StrokeReport(
        motion.stroke, motion.side, motion.tdc_m, set_points.tdc_ref_m, motion.v_mid_m_s,
        demand, 0.5 / lasted_s if begun_ns >= 0 and lasted_s > 0.0 else None,
        power_w, None if target is None else target.within_w, lambda_ratio,
    )  # fmt: skip
