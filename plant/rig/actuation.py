"""Fuel that has flowed and sparks that have struck: the engine's side of the lines' edges."""

from __future__ import annotations

from typing import NamedTuple, TypeVar, final

from hil.values import Value
from hil.wire import pulses
from hil.wire.messages import SPARK_LEFT, VALVES
from hil.wire.pulses import Pulse, PulseTable

_T = TypeVar("_T")
_FIRST_VALVE = VALVES[0]
_ALL_LOW = PulseTable()


@final
class Actuation(Value):
    """The lines, and what has come of them since each side's last dead centre."""

    __slots__ = ("table", "fuel_kg", "spark_ns")

    def __init__(
        self,
        table: PulseTable = _ALL_LOW,
        fuel_kg: tuple[float, float] = (0.0, 0.0),
        spark_ns: tuple[int, int] = (-1, -1),
    ) -> None:
        self.table = table
        self.fuel_kg = fuel_kg
        self.spark_ns = spark_ns


class Injector(NamedTuple):
    """Static flow by side and the dead time before it begins."""

    flow_kg_s: tuple[float, float]
    dead_time_ns: float


def with_table(a: Actuation, table: PulseTable) -> Actuation:
    """Let the lines be others."""
    return Actuation(table, a.fuel_kg, a.spark_ns)


def advance(a: Actuation, injector: Injector, to_ns: float) -> Actuation:
    """Apply every edge up to and at `to_ns`: an opened spark strikes, a closed injector has fed."""
    table, edges = pulses.advance(a.table, to_ns)
    if not edges:
        return a
    fuel_kg, spark_ns = a.fuel_kg, a.spark_ns
    for edge in edges:
        channel = edge.channel
        if channel < SPARK_LEFT:
            if not edge.high:
                fed = fuel_kg[channel] + flowed_kg(edge.pulse, injector, channel, edge.t_ns)
                fuel_kg = _set(fuel_kg, channel, fed)
        elif edge.high and channel < _FIRST_VALVE:
            spark_ns = _set(spark_ns, channel - SPARK_LEFT, edge.t_ns)
    return Actuation(table, fuel_kg, spark_ns)


def flowed_kg(pulse: Pulse, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel let through by time t: flow * (min(t, closing) - opening - dead time), at least 0."""
    open_ns = min(t_ns, pulse.close_ns) - (pulse.open_ns + injector.dead_time_ns)
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
    return Actuation(a.table, _set(a.fuel_kg, side, owed), _set(a.spark_ns, side, -1))


def _set(pair: tuple[_T, _T], index: int, value: _T) -> tuple[_T, _T]:
    return (value, pair[1]) if index == 0 else (pair[0], value)
