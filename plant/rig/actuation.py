"""The pulse table: from pulse orders to fuel that has flowed and sparks that have struck.

Every opening carries its closing, so no order, lost or late, can leave an injector open.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

_T = TypeVar("_T")

INJECTOR_LEFT = 0
INJECTOR_RIGHT = 1
SPARK_LEFT = 2
SPARK_RIGHT = 3
VALVES = 4
"""First of the valve lines: intake and exhaust of the left cylinder, then of the right one."""
CHANNELS = 4
CHANNELS_WITH_VALVES = 8

LATE = "late"
OVERLAP = "overlap"
CONTRADICTORY = "contradictory"
UNKNOWN_CHANNEL = "unknown channel"
TOO_LONG = "too long"
TOO_FAR_AHEAD = "too far ahead"
REASONS = (LATE, OVERLAP, CONTRADICTORY, UNKNOWN_CHANNEL, TOO_LONG, TOO_FAR_AHEAD)

MODULUS_US = 1 << 20
MAX_AHEAD_US = 1 << 19
# Openings up to this far back count as past, not as the next turn of the modulus.
_BACK_US = 1 << 18
MAX_DURATION_US = 20_000
MAX_VALVE_US = 65_535
# An order is sent again until its pulse has closed; this long after, it may still be on its way.
_REPEAT_NS = 100_000_000
NEVER_NS = 1 << 62


class PulseOrder(NamedTuple):
    """One pulse as ordered: opening instant modulo 2^20 us, and duration.

    A duration of nought takes the pulse with that opening back.
    """

    channel: int
    open_us: int
    duration_us: int


class Pulse(NamedTuple):
    """One accepted pulse on the plant's clock, and the order it came from."""

    order: PulseOrder
    open_ns: int
    close_ns: int


class Line(NamedTuple):
    """One channel: the pulse that is open, the one to come, and what was last dealt with."""

    open: Pulse | None = None
    pending: Pulse | None = None
    last: Pulse | None = None
    refused: Pulse | None = None


class PulseTable(NamedTuple):
    """All channels, and what has come of them since each side's last dead centre."""

    lines: tuple[Line, ...] = (Line(),) * CHANNELS
    next_edge_ns: int = NEVER_NS
    fuel_kg: tuple[float, float] = (0.0, 0.0)
    spark_ns: tuple[int, int] = (-1, -1)
    refusals: tuple[int, ...] = (0,) * len(REASONS)


class Injector(NamedTuple):
    """Static flow by side and the dead time before it begins."""

    flow_kg_s: tuple[float, float]
    dead_time_ns: float


def unwrap_us(open_us: int, now_us: int) -> int:
    """Place an instant modulo 2^20 us nearest ahead of now, allowing for the recent past."""
    return now_us - _BACK_US + (open_us - now_us + _BACK_US) % MODULUS_US


def receive(
    table: PulseTable, orders: tuple[PulseOrder, ...], now_ns: int
) -> tuple[PulseTable, tuple[tuple[str, PulseOrder], ...]]:
    """Enter the orders of one tick; each is accepted, known already, or refused with a reason."""
    refused: list[tuple[str, PulseOrder]] = []
    lines = list(table.lines)
    counts = table.refusals
    set_now: set[int] = set()
    for order in orders:
        channel = order.channel
        if not 0 <= channel < len(lines):
            reason: str = UNKNOWN_CHANNEL
        else:
            line = lines[channel]
            if _known(line, order, now_ns):
                continue
            lines[channel], reason = _enter(line, order, now_ns, channel in set_now)
            if not reason:
                set_now.add(channel)
        if reason:
            counts = _counted(counts, reason)
            refused.append((reason, order))
    if not set_now and not refused:
        return table, ()
    entered = tuple(lines)
    return table._replace(lines=entered, next_edge_ns=_next_edge(entered), refusals=counts), tuple(
        refused
    )


def _known(line: Line, order: PulseOrder, now_ns: int) -> bool:
    """Tell whether the order is one that was dealt with before and is only sent again."""
    for pulse in (line.open, line.pending):
        if pulse is not None and pulse.order == order:
            return True
    for pulse in (line.last, line.refused):
        if pulse is not None and pulse.order == order and now_ns - pulse.close_ns < _REPEAT_NS:
            return True
    return False


def _enter(line: Line, order: PulseOrder, now_ns: int, twice: bool) -> tuple[Line, str]:
    """Put a new order into its channel, or tell why not."""
    open_us = unwrap_us(order.open_us, now_ns // 1000)
    pulse = Pulse(order, open_us * 1000, (open_us + order.duration_us) * 1000)
    if order.duration_us == 0:
        return _withdraw(line, pulse.open_ns, now_ns), ""
    reason = _objection(pulse, now_ns)
    running = line.open
    if not reason and running is not None and pulse.open_ns < running.close_ns:
        if pulse.open_ns != running.open_ns:
            reason = OVERLAP
        elif pulse.close_ns < now_ns:
            reason = LATE
        else:
            return line._replace(open=pulse), ""
    if not reason and twice and line.pending is not None:
        reason = CONTRADICTORY
    if not reason and pulse.open_ns < now_ns:
        reason = LATE
    if reason:
        return line._replace(refused=pulse), reason
    return line._replace(pending=pulse), ""


def _withdraw(line: Line, open_ns: int, now_ns: int) -> Line:
    """Take back the pulse with that opening: drop it, or close it now if it is open."""
    running, pending = line.open, line.pending
    if pending is not None and pending.open_ns == open_ns:
        return line._replace(pending=None)
    if running is not None and running.open_ns == open_ns:
        return line._replace(open=running._replace(close_ns=min(running.close_ns, now_ns)))
    return line


def _objection(pulse: Pulse, now_ns: int) -> str:
    """Tell what is wrong with a pulse whatever else its channel does."""
    longest = MAX_DURATION_US if pulse.order.channel < VALVES else MAX_VALVE_US
    if pulse.order.duration_us > longest:
        return TOO_LONG
    if pulse.open_ns - now_ns > MAX_AHEAD_US * 1000:
        return TOO_FAR_AHEAD
    return ""


def _counted(counts: tuple[int, ...], reason: str) -> tuple[int, ...]:
    index = REASONS.index(reason)
    return (*counts[:index], counts[index] + 1, *counts[index + 1 :])


def _next_edge(lines: tuple[Line, ...]) -> int:
    """Find the next instant at which a line changes level."""
    edge = NEVER_NS
    for running, pending, _, _ in lines:
        if running is not None:
            edge = min(edge, running.close_ns)
        elif pending is not None:
            edge = min(edge, pending.open_ns)
    return edge


def advance(table: PulseTable, injector: Injector, to_ns: float) -> PulseTable:
    """Apply every edge up to and at `to_ns`."""
    while table.next_edge_ns <= to_ns:
        for channel, line in enumerate(table.lines):
            if line.open is not None and line.open.close_ns <= table.next_edge_ns:
                table = _close(table, injector, channel, line, line.open)
            elif line.open is None and _opens_by(line, table.next_edge_ns):
                table = _open(table, channel, line)
        table = table._replace(next_edge_ns=_next_edge(table.lines))
    return table


def _opens_by(line: Line, t_ns: int) -> bool:
    return line.pending is not None and line.pending.open_ns <= t_ns


def _open(table: PulseTable, channel: int, line: Line) -> PulseTable:
    lines = _with(table.lines, channel, line._replace(open=line.pending, pending=None))
    if line.pending is None or not SPARK_LEFT <= channel < VALVES:
        return table._replace(lines=lines)
    return table._replace(
        lines=lines, spark_ns=_set(table.spark_ns, channel - SPARK_LEFT, line.pending.open_ns)
    )


def _close(
    table: PulseTable, injector: Injector, channel: int, line: Line, pulse: Pulse
) -> PulseTable:
    lines = _with(table.lines, channel, line._replace(open=None, last=pulse))
    if channel >= SPARK_LEFT:
        return table._replace(lines=lines)
    total = table.fuel_kg[channel] + flowed_kg(pulse, injector, channel, pulse.close_ns)
    return table._replace(lines=lines, fuel_kg=_set(table.fuel_kg, channel, total))


def flowed_kg(pulse: Pulse, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel let through by time t: flow * (min(t, closing) - opening - dead time), at least 0."""
    open_ns = min(t_ns, pulse.close_ns) - (pulse.open_ns + injector.dead_time_ns)
    return injector.flow_kg_s[side] * max(open_ns, 0.0) * 1e-9


def fuel_until(table: PulseTable, injector: Injector, side: int, t_ns: float) -> float:
    """Fuel of a side since it was last taken; the table must stand at t_ns."""
    running = table.lines[side].open
    flowing = flowed_kg(running, injector, side, t_ns) if running is not None else 0.0
    return table.fuel_kg[side] + flowing


def scavenge(table: PulseTable, injector: Injector, side: int, t_ns: float) -> PulseTable:
    """Begin a new charge on that side: its fuel is gone, its spark forgotten."""
    running = table.lines[side].open
    owed = -flowed_kg(running, injector, side, t_ns) if running is not None else 0.0
    if table.fuel_kg[side] == owed and table.spark_ns[side] < 0:
        return table
    return table._replace(
        fuel_kg=_set(table.fuel_kg, side, owed), spark_ns=_set(table.spark_ns, side, -1)
    )


def shut(table: PulseTable, injector: Injector, now_ns: int) -> PulseTable:
    """Close what is open at once and drop what is to come."""
    lines = tuple(
        line._replace(
            open=line.open and line.open._replace(close_ns=min(line.open.close_ns, now_ns)),
            pending=None,
        )
        for line in table.lines
    )
    table = table._replace(lines=lines, next_edge_ns=_next_edge(lines))
    return advance(table, injector, now_ns)


def _with(lines: tuple[Line, ...], channel: int, line: Line) -> tuple[Line, ...]:
    return (*lines[:channel], line, *lines[channel + 1 :])


def _set(pair: tuple[_T, _T], index: int, value: _T) -> tuple[_T, _T]:
    return (value, pair[1]) if index == 0 else (pair[0], value)
