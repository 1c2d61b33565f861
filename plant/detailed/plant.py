"""A tick of the plant with a detailed engine: the same orders, pulses and disturbances.

Built once a run by `plant.params`; `step` has the signature of plant/step.py.
"""

from __future__ import annotations

import numpy as np

from hil.config.plant import PlantConfig
from hil.errors import RunError
from hil.messages import GENERATOR
from plant import actuation, disturbances, orders
from plant.actuation import Injector, Line, PulseTable
from plant.combustion import SIDES, Stroke, efficiency
from plant.detailed import layout as at
from plant.detailed.engine import Engine, Motion, at_rest, begin, engine_of
from plant.detailed.machine import machine_force
from plant.detailed.settle import calibration_of, settle
from plant.detailed.solver import advance, scratch
from plant.detailed.types import Array, GasState
from plant.disturbances import Due, Held
from plant.events import CONTACT, DISTURBANCE, MISFIRE, Event
from plant.machine import MachineOrder, obey
from plant.params import PlantParams
from plant.state import Command, DeadCentre, PlantState

_RECORD_ROWS = 8
_SECOND_NS = 1e9
_FIRST_STROKE_S = 0.02
_WARM_NS = 1e3


def build(config: PlantConfig) -> DetailedPlant:
    """Build the detailed engine that a plant's configuration names.

    Raises: ConfigError when its figures are to be other than its calibration's
    """
    return DetailedPlant(engine_of(calibration_of(config), self_timed=False))


class DetailedPlant:
    """One detailed engine: its constants, and scratch space for the compiled step."""

    def __init__(self, engine: Engine) -> None:
        """Take an engine whose sparks and machine come from outside."""
        self.engine = engine
        self._work = scratch()
        self._record = np.zeros((_RECORD_ROWS, at.N_REC))
        y, d, _ = at_rest(engine)
        self._move(y, d, _WARM_NS)  # compiled, or loaded from the cache, before the first tick

    def initial(
        self, p: PlantParams, rest: PlantState, fuel_kg: float | None, load_n_s_m: float | None
    ) -> PlantState:
        """Begin at rest when `fuel_kg` is None, else at the left dead centre of settled running."""
        if not self.engine.calibration.breathing.ports:
            lines = (Line(),) * actuation.CHANNELS_WITH_VALVES
            rest = rest._replace(pulses=PulseTable(lines=lines))
        if fuel_kg is None:
            y, d, _ = at_rest(self.engine)
            gas = GasState(b"", b"", 0.0, 1.0, _FIRST_STROKE_S, 0.0, 0.0, 0.0)
            return self._finish(rest._replace(gas=gas), y, d)
        c = self.engine.calibration.machine.load_coefficient_n_s_m
        load = c if load_n_s_m is None else load_n_s_m
        found = settle(self.engine.calibration, fuel_kg, load)
        y, d = found.y.copy(), found.d.copy()
        begin(self.engine, Motion(y, d, self._record), 1)
        gas = GasState(b"", b"", 0.0, 1.0, found.stroke_s, 0.0, 0.0, 0.0)
        x = float(y[at.X])
        s = rest._replace(
            gas=gas,
            machine=obey(p, MachineOrder(GENERATOR, 0.0, load), 1.0),
            stroke=Stroke(1, 1, 0, x, fuel_kg),
            dead_centre=DeadCentre(1, 0, x, fuel_kg, 1.0),
        )
        return self._finish(s, y, d)

    def step(
        self, p: PlantParams, s: PlantState, command: Command | None
    ) -> tuple[PlantState, tuple[Event, ...]]:
        """Integrate exactly one tick with the command now in force."""
        events: list[Event] = []
        s = orders.follow(p, s, command, events)
        gas = _gas(s)
        y, d = np.frombuffer(gas.y).copy(), np.frombuffer(gas.d).copy()
        s = self._through(p, s, y, d, events)
        return self._finish(s, y, d), tuple(events)

    def _through(
        self, p: PlantParams, s: PlantState, y: Array, d: Array, events: list[Event]
    ) -> PlantState:
        """Go from one instant of note to the next, to the end of the tick."""
        held = Held(s.x_m, s.v_m_s)
        end_ns = (s.tick + 1) * p.period_ns
        injector = Injector(p.flow_kg_s, p.dead_time_ns)
        while True:
            self._impose(s, d)
            _set_valves(s.pulses, d)
            due_ns = s.stroke.start_ns + s.disturbances.due_s * _SECOND_NS
            until_ns = min(float(end_ns), float(s.pulses.next_edge_ns), due_ns)
            if self._move(y, d, until_ns):
                s = self._dead_centre(p, s, y, d, held, events)
                continue
            if until_ns >= s.pulses.next_edge_ns:
                before = s.pulses
                pulses = actuation.advance(before, injector, before.next_edge_ns)
                s = s._replace(pulses=pulses)
                for side in (0, 1):
                    if pulses.spark_ns[side] > before.spark_ns[side]:
                        s = self._spark(p, s, y, d, side, events)
            if until_ns >= due_ns:
                s = _take_due(p, s, round(until_ns), held, events)
            if until_ns >= end_ns:
                return s._replace(tick=s.tick + 1)

    def _impose(self, s: PlantState, d: Array) -> None:
        """Put the machine's order into the arrays; a drive with a programme of its own keeps it."""
        machine = s.machine
        nominal = self.engine.calibration.machine.load_coefficient_n_s_m
        kind = self.engine.calibration.cycle.kind
        if kind == "speed":
            d[at.LOAD] = d[at.FORCE] = 0.0
        elif kind != "four-stroke":
            d[at.LOAD], d[at.FORCE] = machine.load_coefficient_n_s_m, machine.force_n
        elif machine.order.mode == GENERATOR:
            d[at.LOAD_SCALE] = machine.load_coefficient_n_s_m / nominal
        else:
            d[at.LOAD], d[at.FORCE] = 0.0, machine.force_n

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
        return what != at.TIME_UP

    def _dead_centre(
        self, p: PlantParams, s: PlantState, y: Array, d: Array, held: Held, events: list[Event]
    ) -> PlantState:
        """Enter the dead centre and begin the next stroke."""
        t_ns = round(d[at.DC_T] * _SECOND_NS)
        gas = _gas(s)
        side = 1 if s.stroke.direction > 0 else 0
        contacts = int(d[at.CONTACTS])
        if contacts > s.contacts:
            events.append(Event(t_ns, CONTACT, f"piston against the {SIDES[side]} head"))
        s = _unburnt(p, s, side, t_ns, events)
        lasted = (t_ns - s.stroke.start_ns) / _SECOND_NS
        dis, taken = disturbances.start_stroke(p.edges, s.disturbances, t_ns, lasted)
        for edge in taken:
            due = Due(edge.fraction * gas.stroke_s, edge.event, edge.begins)
            dis = disturbances.put(dis, due)
        number = s.dead_centre.number + 1
        fuel, eta, x = gas.ignited_kg, gas.efficiency, float(d[at.DC_X])
        return s._replace(
            disturbances=dis,
            contacts=contacts,
            stroke=Stroke(number, -s.stroke.direction, t_ns, x, fuel, eta),
            dead_centre=DeadCentre(number, t_ns, x, fuel, eta),
            gas=gas._replace(ignited_kg=0.0, efficiency=1.0, stroke_s=lasted),
        )

    def _spark(
        self, p: PlantParams, s: PlantState, y: Array, d: Array, side: int, events: list[Event]
    ) -> PlantState:
        """Light the charge of a side, or say why it does not burn."""
        t_ns = s.pulses.spark_ns[side]
        injector = Injector(p.flow_kg_s, p.dead_time_ns)
        fuel = actuation.fuel_until(s.pulses, injector, side, t_ns)
        dis, cause = disturbances.take_misfire(s.disturbances)
        s = s._replace(disturbances=dis)
        reason = f"forced, no {cause}" if cause else self._objection(p, s, y, side, fuel)
        pulses = actuation.scavenge(s.pulses, injector, side, t_ns)
        pulses = pulses._replace(spark_ns=s.pulses.spark_ns)
        s = s._replace(pulses=pulses)
        if reason:
            events.append(Event(t_ns, MISFIRE, f"{SIDES[side]}: {reason}"))
            return s
        eta = efficiency(p, s.disturbances.efficiency, s.dead_centre.number + 1)
        e = at.CYL + side * at.CYL_STRIDE
        d[e + at.SPARK_T] = t_ns / _SECOND_NS
        d[e + at.Q_IN] = eta * fuel * self.engine.calibration.heat.heating_value_j_kg
        return s._replace(gas=_gas(s)._replace(ignited_kg=fuel, efficiency=eta))

    def _objection(self, p: PlantParams, s: PlantState, y: Array, side: int, fuel: float) -> str:
        """Tell why a charge does not burn; an empty string when it does."""
        if fuel <= 0.0:
            return "no fuel"
        if not p.fuel_min_kg <= fuel <= p.fuel_max_kg:
            return f"fuel out of range ({fuel * 1e6:.4f} mg)"
        if (side == 1) != (s.stroke.direction > 0):
            return "late spark"
        lowest = self.engine.calibration.cycle.ignition_least_pa
        p_pa = self._pressure(y, side)
        if p_pa < lowest:
            return f"no compression ({p_pa * 1e-5:.2f} bar)"
        return ""

    def _pressure(self, y: Array, side: int) -> float:
        p, b = self.engine.p, at.CYL_P + side * at.CYL_P_STRIDE
        volume = p[b + at.AREA] * (p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X])
        return float((p[at.GAMMA] - 1.0) * y[at.U + at.GAS_STRIDE * side] / volume)

    def _power(self, y: Array, d: Array) -> float:
        """Tell what the machine delivers: a dq machine at its terminals, any other on the mover."""
        v = float(y[at.V])
        if self.engine.p[at.MACHINE] == at.LOAD_CONSTANT:
            return float((d[at.LOAD] * d[at.LOAD_SCALE] * v - d[at.FORCE]) * v)
        rates = self._work[7]
        machine_force(self.engine.p, d, y, rates, 0.0)
        if self.engine.p[at.MACHINE] == at.DQ:
            return -float(rates[at.W_TERMINAL])
        return float(rates[at.W_GENERATED] - rates[at.W_MOTORED])

    def _finish(self, s: PlantState, y: Array, d: Array) -> PlantState:
        """Put the arrays back into the state, with what the sensors are to see."""
        v = float(y[at.V])
        gas = _gas(s)._replace(
            y=y.tobytes(),
            d=d.tobytes(),
            p_left_pa=self._pressure(y, 0),
            p_right_pa=self._pressure(y, 1),
            electric_power_w=self._power(y, d),
        )
        direction = int(d[at.DIRECTION])
        stroke = s.stroke
        if direction and s.dead_centre.number == 0 and stroke.direction != direction:
            stroke = stroke._replace(direction=direction)
        return s._replace(
            x_m=float(y[at.X]), v_m_s=v, gas=gas, stroke=stroke, moving=direction != 0,
            tau_s=float(d[at.T]) - stroke.start_ns / _SECOND_NS,
        )  # fmt: skip


def _set_valves(pulses: PulseTable, d: Array) -> None:
    """Let each valve follow its TTL line from the line's first pulse on, and no longer the piston.

    A step profile: open while the line is high (thesis section 3.3.3).
    """
    for number, line in enumerate(pulses.lines[actuation.VALVES :]):
        if line.open is None and line.last is None:
            continue
        side, valve = divmod(number, 2)
        e = at.CYL + side * at.CYL_STRIDE
        d[e + at.INTAKE_LINE + valve] = 1.0
        d[e + at.INTAKE + valve] = 0.0 if line.open is None else 1.0


def _gas(s: PlantState) -> GasState:
    assert s.gas is not None, "a detailed plant is stepped from a detailed state"
    return s.gas


def _unburnt(
    p: PlantParams, s: PlantState, side: int, t_ns: int, events: list[Event]
) -> PlantState:
    """What was not lit by the dead centre leaves with the exhaust."""
    injector = Injector(p.flow_kg_s, p.dead_time_ns)
    pulses = s.pulses
    if _gas(s).ignited_kg == 0.0 and pulses.spark_ns[side] < 0:
        fuel = actuation.fuel_until(pulses, injector, side, t_ns)
        if fuel > 0.0:
            events.append(Event(t_ns, MISFIRE, f"{SIDES[side]}: no spark"))
    return s._replace(pulses=actuation.scavenge(pulses, injector, side, t_ns))


def _take_due(
    p: PlantParams, s: PlantState, t_ns: int, held: Held, events: list[Event]
) -> PlantState:
    """Begin or end the disturbance that is due now."""
    dis, due = disturbances.pop(s.disturbances)
    dis = disturbances.apply(p.events, dis, due, held)
    what = "begins" if due.begins else "ends"
    text = f"{p.names[due.event]} ({p.events[due.event].kind}) {what}"
    events.append(Event(t_ns, DISTURBANCE, text))
    return s._replace(disturbances=dis, machine=obey(p, s.machine.order, dis.load_scale))
