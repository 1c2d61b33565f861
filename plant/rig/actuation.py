"""Fuel that has flowed and sparks that have struck: the engine's side of the lines' edges."""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from hil.values import Value
from hil.wire import pulses
from hil.wire.messages import SPARK_LEFT, VALVES
from hil.wire.pulses import Pulse, PulseTable
from plant.rig import valves
from plant.rig.valves import IDEAL, UNUSED, ValveActuators, Valves

_FIRST_VALVE = VALVES[0]
_ALL_LOW = PulseTable()


@final
class Actuation(Value):
    """The lines, and what has come of them since each side's last dead centre."""

    __slots__ = ("table", "fuel_kg", "spark_ns", "valves")

    def __init__(
        self,
        table: PulseTable = _ALL_LOW,
        fuel_kg: tuple[float, float] = (0.0, 0.0),
        spark_ns: tuple[i64, i64] = (-1, -1),
        valves: Valves = UNUSED,
    ) -> None:
        self.table = table
        self.fuel_kg = fuel_kg
        self.spark_ns = spark_ns
        self.valves = valves

    @property
    def next_edge_ns(self) -> i64:
        """When the next line changes its level, or the next valve moves."""
        return min(self.table.next_edge_ns, self.valves.next_ns)


@final
class Injector(Value):
    """Static flow by side and the dead time before it begins."""

    __slots__ = ("flow_kg_s", "dead_time_ns")

    def __init__(self, flow_kg_s: tuple[float, float], dead_time_ns: float) -> None:
        self.flow_kg_s = flow_kg_s
        self.dead_time_ns = dead_time_ns


def with_table(a: Actuation, table: PulseTable) -> Actuation:
    """Let the lines be others."""
    return Actuation(table, a.fuel_kg, a.spark_ns, a.valves)


def with_valves(a: Actuation, after: Valves) -> Actuation:
    """Let the valves be others."""
    return Actuation(a.table, a.fuel_kg, a.spark_ns, after)


def advance(
    a: Actuation, injector: Injector, to_ns: float, actuators: ValveActuators = IDEAL
) -> Actuation:
    """Apply every edge up to and at `to_ns`, and every move of a valve.

    An opened spark strikes, a closed injector has fed; a valve's edge moves it after its delay.
    """
    table, edges = pulses.advance(a.table, to_ns)
    if not edges:
        after = valves.moved(a.valves, to_ns)
        return a if after is a.valves else with_valves(a, after)
    fuel_kg, spark_ns, after = a.fuel_kg, a.spark_ns, a.valves
    for edge in edges:
        channel = edge.channel
        if channel < SPARK_LEFT:
            if not edge.high:
                fed_kg = flowed_kg(edge.pulse, injector, channel, float(edge.t_ns))
                fuel_kg = _with_fuel(fuel_kg, channel, fuel_kg[channel] + fed_kg)
        elif channel >= _FIRST_VALVE:
            after = valves.ordered(after, actuators, edge)
        elif edge.high:
            spark_ns = with_spark(spark_ns, channel - SPARK_LEFT, edge.t_ns)
    return Actuation(table, fuel_kg, spark_ns, valves.moved(after, to_ns))


def flowed_kg(pulse: Pulse, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel let through by time t: flow * (min(t, closing) - opening - dead time), at least 0."""
    until_ns = min(t_ns, float(pulse.close_ns))
    open_ns = until_ns - (float(pulse.open_ns) + injector.dead_time_ns)
    return injector.flow_kg_s[side] * max(open_ns, 0.0) * 1e-9


def fuel_until(a: Actuation, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel of a side since it was last taken; the lines must stand at t_ns."""
    running = a.table.lines[side].open
    flowing = flowed_kg(running, injector, side, t_ns) if running is not None else 0.0
    return a.fuel_kg[side] + flowing


def scavenge(a: Actuation, injector: Injector, side: int, t_ns: float) -> Actuation:
    """Begin a new charge on that side: its fuel is gone, its spark forgotten."""
    running = a.table.lines[side].open
    owed = -flowed_kg(running, injector, side, t_ns) if running is not None else 0.0
    if a.fuel_kg[side] == owed and a.spark_ns[side] < 0:
        return a
    fuel_kg = _with_fuel(a.fuel_kg, side, owed)
    return Actuation(a.table, fuel_kg, with_spark(a.spark_ns, side, -1), a.valves)


def _with_fuel(pair_kg: tuple[float, float], side: int, fuel_kg: float) -> tuple[float, float]:
    return (fuel_kg, pair_kg[1]) if side == 0 else (pair_kg[0], fuel_kg)


def with_spark(pair_ns: tuple[i64, i64], side: int, spark_ns: i64) -> tuple[i64, i64]:
    """Let the spark of one side be another."""
    return (spark_ns, pair_ns[1]) if side == 0 else (pair_ns[0], spark_ns)
