"""A Functional Mock-up Unit in the place of the engine (docs/fmu.md): it moves the piston."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final, final

from hil.config.engine.models import DETAILED_MODELS
from hil.config.plant import PlantConfig
from hil.errors import ConfigError, RunError
from hil.values import Value
from plant.engines.fmu.archive import open_archive
from plant.engines.fmu.turning import turning_point
from plant.engines.fmu.unit import Unit
from plant.engines.likeness import settled_tdc_m
from plant.engines.machine import Machine
from plant.engines.protocol import (
    OF_ITS_OWN,
    Ahead,
    Charge,
    Engine,
    Inputs,
    Motion,
    Moved,
    Sensed,
    Stop,
    power_w,
)

Outputs = dict[str, float]

_NO_SPARK_S: Final = -1.0
_SECOND_NS: Final = 1e9
_HALF_NS: Final = 0.5
_HEAD_GAP_M: Final = 1.0e-4
_LONGEST_STROKE_NS: Final = 200_000_000
_STILL: Final = (0.0, 0.0, 0.0, 0.0, _NO_SPARK_S, _NO_SPARK_S)


@final
class UnitState(Value):
    """A unit between two instants; nan where it does not tell a power.

    data: its own state, b"" when it cannot give it
    """

    __slots__ = ("t_ns", "data", "p_left_pa", "p_right_pa", "electric_power_w")

    def __init__(
        self, t_ns: int, data: bytes, p_left_pa: float, p_right_pa: float, electric_power_w: float
    ) -> None:
        self.t_ns = t_ns
        self.data = data
        self.p_left_pa = p_left_pa
        self.p_right_pa = p_right_pa
        self.electric_power_w = electric_power_w


def build(config: PlantConfig, period_ns: int) -> UnitEngine:
    """Open the unit that a plant's configuration names.

    Raises: ConfigError when it cannot be the plant, MissingExtraError without FMPy
    """
    return UnitEngine(config, period_ns)


@final
class UnitEngine(Engine):
    """One unit, checked against the contract.

    Its state goes with the plant's, so that a step is a function of its arguments; a unit that
    cannot be set back can only be stepped forward.
    """

    def __init__(self, config: PlantConfig, period_ns: int) -> None:
        fmu = config.fmu
        self._unit = Unit(open_archive(Path(fmu.file), fmu.sha256), fmu.names, fmu.parameters)
        prototype = config.resolved_prototype()
        super().__init__(
            prototype.load_coefficient_n_s_m, OF_ITS_OWN, splits=self._unit.splits,
            every_stroke=fmu.like != "four-stroke",
        )  # fmt: skip
        self._config = config
        self._period_ns = period_ns
        self._head_m = prototype.half_stroke_m - _HEAD_GAP_M
        self._here = UnitState(-1, b"", 0.0, 0.0, 0.0)
        self._last: Outputs = {}

    def begin(self, charge: Charge | None, load_n_s_m: float) -> Motion:
        """Begin at rest, or at the left dead centre of settled running, the charge burning there.

        Raises: ConfigError when the unit cannot begin so
        """
        if charge is None:
            return self._at(0, self._unit.start(_STILL, 0.0, 0.0))
        if not self._unit.begins_settled:
            raise ConfigError(
                f"{self._unit.path}: cannot begin settled: it has no parameters start_x_m and "
                "start_fuel_kg; accepted: begins = 'at-rest'"
            )
        x_m = -settled_tdc_m(self._config, self._config.fmu.like, charge.fuel_kg, load_n_s_m)
        first = (0.0, load_n_s_m, *_STILL[2:])
        fuel_kg = charge.efficiency * charge.fuel_kg
        m = self._at(0, self._unit.start(first, x_m, fuel_kg))
        return Motion(m.x_m, m.v_m_s, 0.0, True, m.heading, m.inner)

    def advance(self, m: Motion, inputs: Inputs, ahead: Ahead) -> Moved:
        """Take one step, to the tick's end or, if the unit can, to a disturbance before it.

        A unit with a fixed step feels a disturbance from the end of the tick on.
        """
        self._take_back(_state(m))
        now_ns, until_ns = round(ahead.now_ns), ahead.until_ns
        if ahead.due_ns <= now_ns + _HALF_NS:
            return Moved(m, now_ns, 0.0, None, at_edge=False, at_due=True, at_end=False)
        h = ahead.dt_s if until_ns - now_ns == self._period_ns else (until_ns - now_ns) / _SECOND_NS
        last = self._last
        now = self._unit.step(_told(inputs), now_ns / _SECOND_NS, h)
        x, v = now["x_m"], now["v_m_s"]
        if not math.isfinite(x + v):
            raise RunError(f"{self._unit.path}: position {x}, velocity {v} at {until_ns * 1e-9} s")
        stop = self._stop(m, last, now, now_ns, h, ahead.stroke_ns)
        moved = self._at(until_ns, now, ahead.stroke_ns if stop is None else round(stop.t_ns))
        return Moved(moved, until_ns, 0.0, stop, False, False, until_ns >= ahead.end_ns)

    def _take_back(self, s: UnitState) -> None:
        """Bring the unit to this state, unless it is there.

        Raises: RunError when it cannot be set back
        """
        if s.t_ns != self._here.t_ns or s.data != self._here.data:
            self._last, self._here = self._unit.recall(s.data), s

    def _at(self, t_ns: int, now: Outputs, stroke_ns: int = 0) -> Motion:
        """Put into a value what the unit tells, and its own state.

        A pressure that the unit does not have reads 0 Pa, as an empty input of a rack does.
        """
        left, right = now.get("p_left_pa", 0.0), now.get("p_right_pa", 0.0)
        data, power = self._unit.remember(), now.get("electric_power_w", math.nan)
        self._last, self._here = now, UnitState(t_ns, data, left, right, power)
        x, v = now["x_m"], now["v_m_s"]
        heading = 0 if v == 0.0 else 1 if v > 0.0 else -1
        return Motion(x, v, (t_ns - stroke_ns) / _SECOND_NS, v != 0.0, heading, self._here)

    def _stop(
        self, m: Motion, last: Outputs, now: Outputs, t_ns: int, h: float, stroke_ns: int
    ) -> Stop | None:
        """Find the dead centre of a step: as the unit tells it, else from the velocity's turn."""
        if "dead_centres" in now:
            count = int(now["dead_centres"] - last["dead_centres"])
            dc_ns, x = round(now["dc_t_s"] * _SECOND_NS), now["dc_x_m"]
        else:
            turn = turning_point(m.x_m, m.v_m_s, now["x_m"], now["v_m_s"], h)
            count, dc_ns, x = 0, t_ns, 0.0
            if turn is not None:
                count, dc_ns, x = 1, t_ns + round(turn[0] * _SECOND_NS), turn[1]
        if count <= 0:
            return None
        contacts = int(abs(x) >= self._head_m)
        if "contacts" in now:
            contacts = int(now["contacts"] - last["contacts"])
        burnt = now["fuel_burnt_kg"] > 0.0 if "fuel_burnt_kg" in now else None
        lasted_s = (dc_ns - stroke_ns) / _SECOND_NS
        return Stop(dc_ns, x, lasted_s, count, contacts, compressed=True, burnt=burnt)

    def stroke_s(self, m: Motion, machine: Machine, now_ns: int, begun_ns: int) -> float:
        """Run on undisturbed to the end of the stroke, then set back.

        Nought when the unit cannot be set back, when its charge burns before the dead centre (it is
        not known yet how the next one will), or when no dead centre comes.
        """
        if not self._unit.restores or self._config.fmu.like in DETAILED_MODELS:
            return 0.0
        here, before, last = self._unit.remember(), self._last, self._last
        told = (machine.force_n, machine.load_coefficient_n_s_m, *_STILL[2:])
        dt_s, stop = self._period_ns / _SECOND_NS, None
        for t_ns in range(now_ns, now_ns + _LONGEST_STROKE_NS, self._period_ns):
            now = self._unit.step(told, t_ns / _SECOND_NS, dt_s)
            stop = self._stop(m, last, now, t_ns, dt_s, begun_ns)
            if stop is not None:
                break
            last, m = now, Motion(now["x_m"], now["v_m_s"], 0.0, True, 0, None)
        self._unit.recall(here)
        self._last = before
        return 0.0 if stop is None else stop.lasted_s

    def sensed(self, m: Motion, machine: Machine) -> Sensed:
        """Return what the unit tells; a power that it does not is that of the machine."""
        s = _state(m)
        told = not math.isnan(s.electric_power_w)
        power = s.electric_power_w if told else power_w(m, machine)
        return Sensed(s.p_left_pa, s.p_right_pa, power)


def _state(m: Motion) -> UnitState:
    inner = m.inner
    assert isinstance(inner, UnitState)
    return inner


def _told(inputs: Inputs) -> tuple[float, ...]:
    """The unit's inputs in the order of the contract."""
    sparks = [float(ns) / _SECOND_NS if ns >= 0 else _NO_SPARK_S for ns in inputs.spark_ns]
    machine = inputs.machine
    return (machine.force_n, machine.load_coefficient_n_s_m, *inputs.fuel_kg, *sparks)
