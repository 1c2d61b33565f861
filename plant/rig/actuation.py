"""Fuel that has flowed and sparks that have struck: the engine's side of the lines' edges."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.values import Value
from hil.wire import pulses
from hil.wire.messages import SPARK_LEFT, VALVES
from hil.wire.pulses import Pulse, PulseTable
from plant.rig import port, valves
from plant.rig.port import DRY, Port, Wall
from plant.rig.valves import IDEAL, UNUSED, ValveActuators, Valves

_FIRST_VALVE = VALVES[0]
_ALL_LOW = PulseTable()
_BOTH_DRY: Final = (DRY, DRY)


@final
class Actuation(Value):
    """The lines, and what has come of them since each side's last dead centre.

    ports: the intake ports, of injectors that feed them
    spark_m: where the piston was at each spark, along +x
    """

    __slots__ = ("table", "fuel_kg", "spark_ns", "valves", "ports", "spark_m")

    def __init__(
        self,
        table: PulseTable = _ALL_LOW,
        fuel_kg: tuple[float, float] = (0.0, 0.0),
        spark_ns: tuple[i64, i64] = (-1, -1),
        valves: Valves = UNUSED,
        ports: tuple[Port, Port] = _BOTH_DRY,
        spark_m: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.table = table
        self.fuel_kg = fuel_kg
        self.spark_ns = spark_ns
        self.valves = valves
        self.ports = ports
        self.spark_m = spark_m

    @property
    def next_edge_ns(self) -> i64:
        """When the next line changes its level, or the next valve moves."""
        return min(self.table.next_edge_ns, self.valves.next_ns)


@final
class Injector(Value):
    """Static flow by side and the dead time before it begins; the port's wall, None without one."""

    __slots__ = ("flow_kg_s", "dead_time_ns", "wall")

    def __init__(
        self, flow_kg_s: tuple[float, float], dead_time_ns: float, wall: Wall | None = None
    ) -> None:
        self.flow_kg_s = flow_kg_s
        self.dead_time_ns = dead_time_ns
        self.wall = wall


def with_table(a: Actuation, table: PulseTable) -> Actuation:
    """Let the lines be others."""
    return Actuation(table, a.fuel_kg, a.spark_ns, a.valves, a.ports, a.spark_m)


def with_valves(a: Actuation, after: Valves) -> Actuation:
    """Let the valves be others."""
    return Actuation(a.table, a.fuel_kg, a.spark_ns, after, a.ports, a.spark_m)


def with_sparks(a: Actuation, spark_ns: tuple[i64, i64]) -> Actuation:
    """Let the sparks that are known be others."""
    return Actuation(a.table, a.fuel_kg, spark_ns, a.valves, a.ports, a.spark_m)


def with_place(a: Actuation, side: int, spark_m: float) -> Actuation:
    """Enter where the piston was at the spark of a side."""
    both = (spark_m, a.spark_m[1]) if side == 0 else (a.spark_m[0], spark_m)
    return Actuation(a.table, a.fuel_kg, a.spark_ns, a.valves, a.ports, both)


def with_ports(a: Actuation, ports: tuple[Port, Port]) -> Actuation:
    """Let the ports be others."""
    return Actuation(a.table, a.fuel_kg, a.spark_ns, a.valves, ports, a.spark_m)


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
    fuel_kg, spark_ns, after, ports = a.fuel_kg, a.spark_ns, a.valves, a.ports
    for edge in edges:
        channel = edge.channel
        if channel < SPARK_LEFT:
            if edge.high:
                continue
            if injector.wall is not None:
                ports = _wetted(
                    ports, injector, injector.wall, channel, edge.pulse, float(edge.t_ns)
                )
            else:
                fed_kg = flowed_kg(edge.pulse, injector, channel, float(edge.t_ns))
                fuel_kg = _with_fuel(fuel_kg, channel, fuel_kg[channel] + fed_kg)
        elif channel >= _FIRST_VALVE:
            after = valves.ordered(after, actuators, edge)
        elif edge.high:
            spark_ns = with_spark(spark_ns, channel - SPARK_LEFT, edge.t_ns)
    return Actuation(table, fuel_kg, spark_ns, valves.moved(after, to_ns), ports, a.spark_m)


def _wetted(
    ports: tuple[Port, Port], injector: Injector, wall: Wall, side: int, pulse: Pulse | None,
    t_ns: float,
) -> tuple[Port, Port]:  # fmt: skip
    """The ports, one of them at an instant; its injector's pulse is open, or has just closed."""
    from_ns = to_ns = t_ns
    if pulse is not None:
        from_ns, to_ns = float(pulse.open_ns) + injector.dead_time_ns, float(pulse.close_ns)
    at = port.later(wall, ports[side], injector.flow_kg_s[side], from_ns, to_ns, t_ns)
    return with_port(ports, side, at)


def with_port(pair: tuple[Port, Port], side: int, one: Port) -> tuple[Port, Port]:
    """Let the port of one side be another."""
    return (one, pair[1]) if side == 0 else (pair[0], one)


def shut(a: Actuation, injector: Injector, side: int, t_ns: float, stroke: i64) -> Actuation:
    """Close the intake of a side: what is vapour in its port by then is its charge."""
    wall = injector.wall
    assert wall is not None, "an intake without a port"
    ports = _wetted(a.ports, injector, wall, side, a.table.lines[side].open, t_ns)
    ports = with_port(ports, side, port.shut(ports[side], stroke))
    return Actuation(a.table, a.fuel_kg, a.spark_ns, a.valves, ports, a.spark_m)


def flowed_kg(pulse: Pulse, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel let through by time t: flow * (min(t, closing) - opening - dead time), at least 0."""
    until_ns = min(t_ns, float(pulse.close_ns))
    open_ns = until_ns - (float(pulse.open_ns) + injector.dead_time_ns)
    return injector.flow_kg_s[side] * max(open_ns, 0.0) * 1e-9


def fuel_until(a: Actuation, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel of a side since it was last taken; the lines must stand at t_ns."""
    if injector.wall is not None:
        return a.ports[side].charge_kg
    running = a.table.lines[side].open
    flowing = flowed_kg(running, injector, side, t_ns) if running is not None else 0.0
    return a.fuel_kg[side] + flowing


def scavenge(a: Actuation, injector: Injector, side: int, t_ns: float) -> Actuation:
    """Begin a new charge on that side: its fuel is gone, its spark forgotten."""
    if injector.wall is not None:
        ports = with_port(a.ports, side, port.emptied(a.ports[side]))
        return Actuation(
            a.table, a.fuel_kg, with_spark(a.spark_ns, side, -1), a.valves, ports, a.spark_m
        )
    running = a.table.lines[side].open
    owed = -flowed_kg(running, injector, side, t_ns) if running is not None else 0.0
    if a.fuel_kg[side] == owed and a.spark_ns[side] < 0:
        return a
    fuel_kg = _with_fuel(a.fuel_kg, side, owed)
    return Actuation(
        a.table, fuel_kg, with_spark(a.spark_ns, side, -1), a.valves, a.ports, a.spark_m
    )


def _with_fuel(pair_kg: tuple[float, float], side: int, fuel_kg: float) -> tuple[float, float]:
    return (fuel_kg, pair_kg[1]) if side == 0 else (pair_kg[0], fuel_kg)


def with_spark(pair_ns: tuple[i64, i64], side: int, spark_ns: i64) -> tuple[i64, i64]:
    """Let the spark of one side be another."""
    return (spark_ns, pair_ns[1]) if side == 0 else (pair_ns[0], spark_ns)
