"""A detailed engine as the rig drives it: sparks, machine and valve lines from outside."""

from __future__ import annotations

from typing import Final, final

import numpy as np

from hil.config.detailed import Calibration
from hil.config.plant import PlantConfig
from hil.errors import RunError
from hil.values import Value
from hil.wire.messages import GENERATOR
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Motion as Arrays
from plant.engines.detailed.engine import at_rest, begin, engine_of
from plant.engines.detailed.kernel import electric_power
from plant.engines.detailed.settle import calibration_of, settle
from plant.engines.detailed.solver import advance, scratch
from plant.engines.detailed.types import Array
from plant.engines.machine import Machine
from plant.engines.protocol import (
    BY_SPARK,
    Ahead,
    Charge,
    Engine,
    Inputs,
    Motion,
    Moved,
    Sensed,
    Stop,
)

_RECORD_ROWS: Final = 8
_SECOND_NS: Final = 1e9
_FIRST_STROKE_S: Final = 0.02
_WARM_NS: Final = 1e3
_VALVE_LINES: Final = 4
_STROKES: Final = {"four-stroke": 4}
"""Strokes of a cycle, two of any other."""
_RATES: Final = 7
"""Row of the scratch space that rates are written to."""


@final
class DetailedState(Value):
    """The engine between two instants; y and d are the bytes of the solver's arrays.

    contacts: those that the rig has been told of
    lasted_s: durations of the strokes of a cycle before this one, the oldest first
    """

    __slots__ = ("y", "d", "contacts", "lasted_s")

    def __init__(self, y: bytes, d: bytes, contacts: int, lasted_s: tuple[float, ...]) -> None:
        self.y = y
        self.d = d
        self.contacts = contacts
        self.lasted_s = lasted_s


def build(config: PlantConfig, _period_ns: int) -> DetailedEngine:
    """Build the detailed engine that a plant's configuration names.

    Raises: ConfigError when its figures are to be other than its calibration's
    """
    return DetailedEngine(calibration_of(config), config.drive == "programme")


@final
class DetailedEngine(Engine):
    """One detailed engine: its constants, and scratch space for the compiled step."""

    def __init__(self, calibration: Calibration, programmed: bool = True) -> None:
        lines = 0 if calibration.breathing.ports else _VALVE_LINES
        load = calibration.machine.load_coefficient_n_s_m
        lift_m = calibration.breathing.lift_m
        super().__init__(load, BY_SPARK, valves=lines, valve_lift_m=lift_m)
        self.engine = engine_of(calibration, self_timed=False, programmed=programmed)
        self._drives = programmed and calibration.cycle.kind == "four-stroke"
        self._work = scratch()
        self._record = np.zeros((_RECORD_ROWS, at.N_REC))
        y, d, _ = at_rest(self.engine)
        self._move(y, d, _WARM_NS)  # compiled, or loaded from the cache, before the first tick

    def begin(self, charge: Charge | None, load_n_s_m: float) -> Motion:
        """Begin at rest, or at the left dead centre of settled running with the charge alight.

        Raises: ConfigError when the engine stops at these settings
        """
        if charge is None:
            y, d, _ = at_rest(self.engine)
            return _motion(y, d, 0, 0, self._cycle_of(_FIRST_STROKE_S))
        found = settle(self.engine.calibration, charge.fuel_kg, load_n_s_m)
        y, d = found.y.copy(), found.d.copy()
        begin(self.engine, Arrays(y, d, self._record), 1)
        return _motion(y, d, 0, 0, self._cycle_of(found.stroke_s))

    def _cycle_of(self, stroke_s: float) -> tuple[float, ...]:
        """Durations of a cycle of equal strokes, until there are others."""
        return (stroke_s,) * _STROKES.get(self.engine.calibration.cycle.kind, 2)

    def advance(self, m: Motion, inputs: Inputs, ahead: Ahead) -> Moved:
        """Move on to the next dead centre, edge or disturbance, or to the tick's end."""
        s = _state(m)
        y, d = _arrays(s)
        self._impose(inputs.machine, d)
        self._throttle(inputs.intake)
        _set_valves(inputs.valves, d)
        until_ns = min(float(ahead.end_ns), float(ahead.edge_ns), ahead.due_ns)
        if self._move(y, d, until_ns):
            return self._stopped(s, y, d, ahead)
        moved = _motion(y, d, ahead.stroke_ns, s.contacts, s.lasted_s)
        at_edge, at_due = until_ns >= ahead.edge_ns, until_ns >= ahead.due_ns
        return Moved(moved, until_ns, 0.0, None, at_edge, at_due, until_ns >= ahead.end_ns)

    def _stopped(self, s: DetailedState, y: Array, d: Array, ahead: Ahead) -> Moved:
        """Tell of the dead centre; the solver has turned already."""
        t_ns = round(d[at.DC_T] * _SECOND_NS)
        lasted_s = (t_ns - ahead.stroke_ns) / _SECOND_NS
        contacts = int(d[at.CONTACTS])
        stop = Stop(t_ns, float(d[at.DC_X]), lasted_s, 1, contacts - s.contacts, True, None)
        motion = _motion(y, d, t_ns, contacts, (*s.lasted_s[1:], lasted_s))
        return Moved(motion, t_ns, 0.0, stop, False, False, False)

    def _impose(self, machine: Machine, d: Array) -> None:
        """Put the machine's order into the arrays; a drive with a programme of its own keeps it."""
        calibration = self.engine.calibration
        load = machine.load_coefficient_n_s_m
        kind = calibration.cycle.kind
        if kind == "speed":
            d[at.LOAD] = d[at.FORCE] = 0.0
        elif not self._drives:
            d[at.LOAD], d[at.FORCE] = load, machine.force_n
        elif machine.order.mode == GENERATOR:
            d[at.LOAD_SCALE] = load / calibration.machine.load_coefficient_n_s_m
        else:
            d[at.LOAD], d[at.FORCE] = 0.0, machine.force_n

    def _throttle(self, share: float) -> None:
        """Put the manifold's pressure in place, as a share of the open throttle's."""
        intake_pa = self.engine.calibration.breathing.intake_pa * share
        for base in (at.CYL_P, at.CYL_P + at.CYL_P_STRIDE):
            self.engine.p[base + at.P_IN] = intake_pa

    def _move(self, y: Array, d: Array, until_ns: float) -> bool:
        """Move on; true when a dead centre or a contact has come first.

        Raises: RunError when the motion cannot be followed
        """
        what = advance(
            self.engine.p, d, y, self.engine.programme, self._work, self._record,
            until_ns / _SECOND_NS, True,
        )  # fmt: skip
        if what == at.FAILED:
            raise RunError(f"plant: the detailed engine cannot be followed at {d[at.T]:.6f} s")
        return bool(what != at.TIME_UP)

    def light(self, m: Motion, side: int, t_ns: int, fuel_kg: float) -> tuple[Motion, str]:
        """Begin the heat release of a side, where there is compression."""
        s = _state(m)
        y, d = _arrays(s)
        p_pa = self._pressure(y, side)
        if p_pa < self.engine.calibration.cycle.ignition_least_pa:
            return m, f"no compression ({p_pa * 1e-5:.2f} bar)"
        e = at.CYL + side * at.CYL_STRIDE
        d[e + at.SPARK_T] = t_ns / _SECOND_NS
        d[e + at.Q_IN] = fuel_kg * self.engine.calibration.heat.heating_value_j_kg
        lit = DetailedState(s.y, d.tobytes(), s.contacts, s.lasted_s)
        return Motion(m.x_m, m.v_m_s, m.tau_s, m.moving, m.heading, lit), ""

    def gaps_m(self, m: Motion) -> tuple[float, float]:
        """Distance of the piston from the left and from the right head."""
        c = self.engine.calibration
        return c.left.length_m + m.x_m, c.right.length_m - m.x_m

    def cycle(self, m: Motion, side: int) -> tuple[float, float, float]:
        """Peak pressure, its position and steepest rise, as every step of the solver saw it."""
        d, e = np.frombuffer(_state(m).d), at.CYL + side * at.CYL_STRIDE
        return float(d[e + at.CYCLE_P]), float(d[e + at.CYCLE_X]), float(d[e + at.CYCLE_RISE])

    def stroke_s(self, m: Motion, _machine: Machine, _now_ns: int, _begun_ns: int) -> float:
        """The same stroke of the cycle before; how this one ends is not known before it is over."""
        return _state(m).lasted_s[0]

    def sensed(self, m: Motion, _machine: Machine) -> Sensed:
        """Return what the arrays hold."""
        y, d = _arrays(_state(m))
        power_w = electric_power(self.engine.p, d, y, self._work[_RATES])
        return Sensed(self._pressure(y, 0), self._pressure(y, 1), power_w)

    def _pressure(self, y: Array, side: int) -> float:
        p, b = self.engine.p, at.CYL_P + side * at.CYL_P_STRIDE
        volume = p[b + at.AREA] * (p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X])
        return float((p[at.GAMMA] - 1.0) * y[at.U + at.GAS_STRIDE * side] / volume)


def _state(m: Motion) -> DetailedState:
    inner = m.inner
    assert isinstance(inner, DetailedState)
    return inner


def _arrays(s: DetailedState) -> tuple[Array, Array]:
    """Copies of y and d, to be changed in place."""
    return np.frombuffer(s.y).copy(), np.frombuffer(s.d).copy()


def _motion(
    y: Array, d: Array, stroke_ns: int, contacts: int, lasted_s: tuple[float, ...]
) -> Motion:
    """Put the arrays into a value; before the first dead centre they say where it goes."""
    direction = int(d[at.DIRECTION])
    inner = DetailedState(y.tobytes(), d.tobytes(), contacts, lasted_s)
    tau_s = float(d[at.T]) - stroke_ns / _SECOND_NS
    heading = direction if d[at.DC_NUMBER] == 0.0 else 0
    return Motion(float(y[at.X]), float(y[at.V]), tau_s, direction != 0, heading, inner)


def _set_valves(levels: tuple[int, ...], d: Array) -> None:
    """Let each valve follow its TTL line from the line's first pulse on, and no longer the piston.

    A step profile: open or shut (thesis section 3.3.3).
    """
    for number, level in enumerate(levels):
        if level < 0:
            continue
        side, valve = divmod(number, 2)
        e = at.CYL + side * at.CYL_STRIDE
        d[e + at.INTAKE_LINE + valve] = 1.0
        d[e + at.INTAKE + valve] = float(level)
