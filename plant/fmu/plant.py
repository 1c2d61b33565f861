"""A tick of the plant with a Functional Mock-up Unit for its engine (docs/fmu.md).

Built once a run by `plant.params`; `step` has the signature of plant/step.py. Pulses, disturbances,
machine orders and the safe state are ours; the unit moves the piston.
"""

from __future__ import annotations

import math
from importlib import import_module
from pathlib import Path

from hil.config.plant import DETAILED_MODELS, PlantConfig
from hil.errors import ConfigError, RunError
from hil.messages import GENERATOR
from plant import actuation, disturbances
from plant.actuation import Injector
from plant.combustion import Stroke
from plant.detailed.types import GasState
from plant.disturbances import Due, Held
from plant.events import Event
from plant.fmu import tick as within
from plant.fmu.archive import open_archive
from plant.fmu.tick import NO_SPARK_S, SECOND_NS, Outputs
from plant.fmu.unit import Unit
from plant.limit_cycle import limit_cycle
from plant.machine import MachineOrder, obey
from plant.orders import follow
from plant.params import PlantParams, engine_of
from plant.state import Command, DeadCentre, PlantState

_LONGEST_STROKE_NS = 200_000_000


def build(config: PlantConfig) -> FmuPlant:
    """Open the unit that a plant's configuration names.

    Raises: ConfigError when it cannot be the plant, MissingExtraError without FMPy
    """
    return FmuPlant(config)


class FmuPlant:
    """One unit in the place of the engine.

    Its state goes with the plant's, so that a step is a function of its arguments; a unit that
    cannot be set back can only be stepped forward.
    """

    def __init__(self, config: PlantConfig) -> None:
        """Open the unit and check it against the contract."""
        fmu = config.fmu
        archive = open_archive(Path(fmu.file), fmu.sha256)
        self._unit = Unit(archive, fmu.names, fmu.parameters)
        self._config = config
        self._state = b""
        self._tick = -1
        self._last: Outputs = {}

    def initial(
        self, p: PlantParams, rest: PlantState, fuel_kg: float | None, load_n_s_m: float | None
    ) -> PlantState:
        """Begin at rest when `fuel_kg` is None, else at the left dead centre of settled running.

        Raises: ConfigError when the unit cannot begin so
        """
        if fuel_kg is None:
            outputs = self._unit.start((0.0, 0.0, 0.0, 0.0, NO_SPARK_S, NO_SPARK_S), 0.0, 0.0)
            return self._finish(rest, outputs)
        if not self._unit.begins_settled:
            raise ConfigError(
                f"{self._unit.path}: cannot begin settled: it has no parameters start_x_m and "
                "start_fuel_kg; accepted: begins = 'at-rest'"
            )
        load = p.load_coefficient_n_s_m if load_n_s_m is None else load_n_s_m
        x_m = -settled_tdc_m(self._config, fuel_kg, load)
        first = (0.0, load, 0.0, 0.0, NO_SPARK_S, NO_SPARK_S)
        eta = within.first_efficiency(p, rest)
        outputs = self._unit.start(first, x_m, eta * fuel_kg)
        self._last = outputs
        machine = obey(p, MachineOrder(GENERATOR, 0.0, load), 1.0)
        stroke_s = 0.0
        if within.awaits_fraction(p, rest, 0):
            stroke_s = self._undisturbed_s(p, rest._replace(x_m=x_m, machine=machine), 0, 0)
        dis, taken = disturbances.start_stroke(p.edges, rest.disturbances, 0, 0.0)
        for edge in taken:
            dis = disturbances.put(dis, Due(edge.fraction * stroke_s, edge.event, edge.begins))
        s = rest._replace(
            machine=machine,
            stroke=Stroke(1, 1, 0, x_m, fuel_kg, eta),
            dead_centre=DeadCentre(1, 0, x_m, fuel_kg, eta),
            disturbances=dis,
            moving=True,
        )
        return self._finish(s, outputs)

    def step(
        self, p: PlantParams, s: PlantState, command: Command | None
    ) -> tuple[PlantState, tuple[Event, ...]]:
        """Let the unit move through exactly one tick with the command now in force."""
        events: list[Event] = []
        self._take_back(s)
        s = follow(p, s, command, events)
        held = Held(s.x_m, s.v_m_s)
        now_ns, end_ns = s.tick * p.period_ns, (s.tick + 1) * p.period_ns
        while now_ns < end_ns:
            s = within.apply_dues(p, s, now_ns, held, events)
            until_ns = self._until(s, now_ns, end_ns)
            s = self._move(p, s, now_ns, until_ns, events)
            now_ns = until_ns
        s = within.note_rest(s, end_ns, events)
        tau_s = (end_ns - s.stroke.start_ns) / SECOND_NS
        return self._finish(s._replace(tick=s.tick + 1, tau_s=tau_s), self._last), tuple(events)

    def _take_back(self, s: PlantState) -> None:
        """Bring the unit to this state, unless it is there.

        Raises: RunError when it cannot be set back
        """
        state = b"" if s.gas is None else s.gas.y
        if s.tick == self._tick and state == self._state:
            return
        self._last = self._unit.recall(state)

    def _until(self, s: PlantState, now_ns: int, end_ns: int) -> int:
        """Where this part of the tick ends: at a disturbance inside it, if the unit can stop there.

        A unit with a fixed step feels the disturbance from the end of the tick on.
        """
        due_ns = s.stroke.start_ns + s.disturbances.due_s * SECOND_NS
        if self._unit.splits and now_ns < due_ns < end_ns:
            return min(max(round(due_ns), now_ns + 1), end_ns)
        return end_ns

    def _move(
        self, p: PlantParams, s: PlantState, now_ns: int, until_ns: int, events: list[Event]
    ) -> PlantState:
        """Let the unit take one step, and enter the dead centre that lies in it."""
        injector = Injector(p.flow_kg_s, p.dead_time_ns)
        told = within.inputs(p, s, injector, until_ns)
        span_ns = until_ns - now_ns
        h = p.dt_s if span_ns == p.period_ns else span_ns / SECOND_NS
        now = self._unit.step(told, now_ns / SECOND_NS, h)
        reached = within.reached(p, s, self._last, now, now_ns, h)
        self._last = now
        if reached is not None:
            stroke_s = (reached.t_ns - s.stroke.start_ns) / SECOND_NS
            if within.awaits_fraction(p, s, reached.t_ns):
                here = s._replace(x_m=now["x_m"], v_m_s=now["v_m_s"])
                stroke_s = self._undisturbed_s(p, here, until_ns, reached.t_ns) or stroke_s
            every = self._config.fmu.like != "four-stroke"
            s = within.dead_centre(p, s, reached, stroke_s, events, every=every)
        if s.pulses.next_edge_ns <= until_ns:
            s = s._replace(pulses=actuation.advance(s.pulses, injector, until_ns))
        x, v = now["x_m"], now["v_m_s"]
        if not math.isfinite(x + v):
            raise RunError(f"{self._unit.path}: position {x}, velocity {v} at {until_ns * 1e-9} s")
        if v != 0.0 and (v > 0.0) != (s.stroke.direction > 0):
            s = s._replace(stroke=s.stroke._replace(direction=1 if v > 0.0 else -1))
        return s._replace(x_m=x, v_m_s=v)

    def _undisturbed_s(self, p: PlantParams, s: PlantState, now_ns: int, begun_ns: int) -> float:
        """Duration of the stroke under way if nothing disturbs it: run on, then set back.

        Nought when the unit cannot be set back, when its charge burns before the dead centre (it is
        not known yet how the next one will), or when no dead centre comes.
        """
        if not self._unit.restores or self._config.fmu.like in DETAILED_MODELS:
            return 0.0
        here, last = self._unit.remember(), self._last
        _, load, force = s.machine
        told = (force, load, 0.0, 0.0, NO_SPARK_S, NO_SPARK_S)
        found = None
        for tick in range(_LONGEST_STROKE_NS // p.period_ns):
            t_ns = now_ns + tick * p.period_ns
            now = self._unit.step(told, t_ns / SECOND_NS, p.dt_s)
            found = within.reached(p, s, last, now, t_ns, p.dt_s)
            if found is not None:
                break
            last, s = now, s._replace(x_m=now["x_m"], v_m_s=now["v_m_s"])
        self._unit.recall(here)
        return 0.0 if found is None else (found.t_ns - begun_ns) / SECOND_NS

    def _finish(self, s: PlantState, outputs: Outputs) -> PlantState:
        """Put into the state what the sensors are to see, and the unit's own state.

        A pressure that the unit does not have reads 0 Pa, as an empty input of a rack does.
        """
        self._last, self._tick = outputs, s.tick
        self._state = self._unit.remember()
        x, v = outputs["x_m"], outputs["v_m_s"]
        power = s.machine.load_coefficient_n_s_m * v * v - s.machine.force_n * v
        gas = GasState(
            self._state, b"", 0.0, 1.0, 0.0, outputs.get("p_left_pa", 0.0),
            outputs.get("p_right_pa", 0.0), outputs.get("electric_power_w", power),
        )  # fmt: skip
        return s._replace(x_m=x, v_m_s=v, gas=gas)


def settled_tdc_m(config: PlantConfig, fuel_kg: float, load_n_s_m: float) -> float:
    """Dead centre of the settled motion, by the model of ours that the unit is like.

    Raises: ConfigError when there is no such motion
    """
    like = config.fmu.like
    if like in DETAILED_MODELS:
        module = import_module("plant.detailed.settle")
        calibration = module.calibration_of(config.model_copy(update={"model": like}))
        return -float(module.settle(calibration, fuel_kg, load_n_s_m).y[0])
    return limit_cycle(engine_of(config.resolved_prototype(), like), fuel_kg, load_n_s_m).tdc_m
