"""Pulses on the wire and what they mean: one table of lines for the model and for real outputs.

An order enters at a tick's start and is accepted, known already, or refused with a reason; from it
follow the edges of its line. Every opening carries its closing, so no order, lost or late, can
leave a line high. All times are on the plant's clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, final

from mypy_extensions import i64

from hil.values import NEVER, Value, replace
from hil.wire import messages
from hil.wire.messages import CHANNELS, FIRING_MODES, INTAKE_LEFT, PULSE_CLOCK_US

INJECTOR, SPARK, VALVE = "injector", "spark", "valve"
KINDS: Final = tuple(
    kind if (kind := name.partition("_")[0]) in (INJECTOR, SPARK) else VALVE
    for name in CHANNELS.values()
)
"""What each channel drives."""

WITHOUT_VALVES: Final = INTAKE_LEFT
"""Lines of an engine whose piston opens its ports: injectors and sparks only."""

LONGEST_US: Final = {INJECTOR: 20_000, SPARK: 20_000, VALVE: 150_000}
FURTHEST_US: Final = PULSE_CLOCK_US // 2
BACK_US: Final = PULSE_CLOCK_US // 4
"""Openings up to this far back count as past, not as the next turn of the clock."""

REPEAT_NS: Final = 100_000_000
"""An order is sent until its pulse has closed; so long after, it may still be on its way."""

LATE, OVERLAP, CONTRADICTORY = "late", "overlap", "contradictory"
UNKNOWN_CHANNEL, TOO_LONG, TOO_FAR_AHEAD = "unknown channel", "too long", "too far ahead"
REASONS: Final = (LATE, OVERLAP, CONTRADICTORY, UNKNOWN_CHANNEL, TOO_LONG, TOO_FAR_AHEAD)


@final
class PulseOrder(Value):
    """One pulse as ordered: opening instant modulo 2^20 us, and duration.

    A duration of nought takes the pulse with that opening back.
    """

    __slots__ = ("channel", "open_us", "duration_us")

    def __init__(self, channel: i64, open_us: i64, duration_us: i64) -> None:
        self.channel = channel
        self.open_us = open_us
        self.duration_us = duration_us


@final
class Pulse(Value):
    """One pulse on the plant's clock, and the order it came from."""

    __slots__ = ("order", "open_ns", "close_ns")

    def __init__(self, order: PulseOrder, open_ns: i64, close_ns: i64) -> None:
        self.order = order
        self.open_ns = open_ns
        self.close_ns = close_ns


@final
class Line(Value):
    """One channel: the pulse that is open, the one to come, and what was last dealt with."""

    __slots__ = ("open", "pending", "last", "refused")

    def __init__(
        self, open: Pulse | None = None, pending: Pulse | None = None,
        last: Pulse | None = None, refused: Pulse | None = None,
    ) -> None:  # fmt: skip
        self.open = open
        self.pending = pending
        self.last = last
        self.refused = refused


@final
class PulseTable(Value):
    """All channels, when the next of them changes its level, and how often what was refused."""

    __slots__ = ("lines", "next_edge_ns", "refusals")

    def __init__(
        self, lines: tuple[Line, ...] = (Line(),) * WITHOUT_VALVES,
        next_edge_ns: i64 = NEVER, refusals: tuple[int, ...] = (0,) * len(REASONS),
    ) -> None:  # fmt: skip
        self.lines = lines
        self.next_edge_ns = next_edge_ns
        self.refusals = refusals


@final
class Edge(Value):
    """A line that changes its level, and the pulse that begins or ends with it."""

    __slots__ = ("t_ns", "channel", "high", "pulse")

    def __init__(self, t_ns: i64, channel: int, high: bool, pulse: Pulse) -> None:
        self.t_ns = t_ns
        self.channel = channel
        self.high = high
        self.pulse = pulse


Refusals = tuple[tuple[str, PulseOrder], ...]
_NO_REFUSALS: Final[Refusals] = ()
_NO_EDGES: Final[tuple[Edge, ...]] = ()


def lines_for(count: int) -> PulseTable:
    """Return a table of the first so many channels, all of them low."""
    return PulseTable((Line(),) * count)


def may_fire(mode: int) -> bool:
    """Whether a line may be high in an operating mode."""
    return mode in FIRING_MODES


def wrap_us(t_ns: int) -> int:
    """Return an instant as the wire carries it: microseconds modulo 2^20."""
    return t_ns // 1000 % PULSE_CLOCK_US


def unwrap_ns(open_us: i64, now_ns: i64) -> i64:
    """Return the instant that 20 bits of us mean: in [now - 2^18 us, now + 3 2^18 us) [ns]."""
    now_us = now_ns // 1000
    return (now_us - BACK_US + (open_us - now_us + BACK_US) % PULSE_CLOCK_US) * 1000


def orders_of(sent: Sequence[messages.Pulse]) -> tuple[PulseOrder, ...]:
    """Return what the pulse frames of an answer order."""
    return tuple([PulseOrder(p.channel, p.open_us, p.duration_us) for p in sent])


def superseded(older: list[messages.Pulse], newer: list[messages.Pulse]) -> list[messages.Pulse]:
    """Of two answers that act in one tick the newer one counts, channel by channel."""
    channels = [pulse.channel for pulse in newer]
    return [pulse for pulse in older if pulse.channel not in channels] + newer


def follow(
    table: PulseTable, fires: bool, orders: tuple[PulseOrder, ...], now_ns: i64
) -> tuple[PulseTable, Refusals]:
    """Take what a tick's answer says of the lines, at the tick's start.

    Parameters: fires : whether the answer's mode lets a line be high
    Returns: the table, some of whose edges may be due now, and which orders were refused and why
    """
    if not fires:
        return shut(table, now_ns), _NO_REFUSALS
    return receive(table, orders, now_ns) if orders else (table, _NO_REFUSALS)


def receive(
    table: PulseTable, orders: tuple[PulseOrder, ...], now_ns: i64
) -> tuple[PulseTable, Refusals]:
    """Enter the orders of one tick; each is accepted, known already, or refused with a reason."""
    lines, counts = list(table.lines), table.refusals
    if all(_known(lines, order, now_ns) for order in orders):
        return table, _NO_REFUSALS  # ordinarily: an order is sent until its pulse has closed
    refused: list[tuple[str, PulseOrder]] = []
    set_now: set[i64] = set()
    for order in orders:
        if _known(lines, order, now_ns):
            continue
        channel, reason = order.channel, UNKNOWN_CHANNEL
        if 0 <= channel < len(lines):
            lines[channel], reason = _enter(lines[channel], order, now_ns, channel in set_now)
        if reason:
            counts = _counted(counts, reason)
            refused.append((reason, order))
        else:
            set_now.add(channel)
    return PulseTable(tuple(lines), _next_edge(lines), counts), tuple(refused)


def _known(lines: list[Line], order: PulseOrder, now_ns: i64) -> bool:
    """Tell whether the order is one that was dealt with before and is only sent again."""
    if not 0 <= order.channel < len(lines):
        return False
    line = lines[order.channel]
    over = _repeats(line.last, order, now_ns) or _repeats(line.refused, order, now_ns)
    return over or _is(line.open, order) or _is(line.pending, order)


def _repeats(pulse: Pulse | None, order: PulseOrder, now_ns: i64) -> bool:
    """Tell whether the order of a pulse that is over may still be on its way."""
    return pulse is not None and _is(pulse, order) and now_ns - pulse.close_ns < REPEAT_NS


def _is(pulse: Pulse | None, order: PulseOrder) -> bool:
    """Tell whether a pulse of the order's channel came from an equal order."""
    if pulse is None:
        return False
    first = pulse.order
    return first.open_us == order.open_us and first.duration_us == order.duration_us


def _enter(line: Line, order: PulseOrder, now_ns: i64, twice: bool) -> tuple[Line, str]:
    """Put a new order into its channel, or tell why not."""
    open_ns = unwrap_ns(order.open_us, now_ns)
    pulse = Pulse(order, open_ns, open_ns + order.duration_us * 1000)
    if order.duration_us == 0:
        return _withdraw(line, open_ns, now_ns), ""
    moves = line.open is not None and line.open.open_ns == open_ns
    reason = _objection(line, pulse, now_ns, moves)
    if not reason and twice and line.pending is not None and not moves:
        reason = CONTRADICTORY
    if reason or moves:
        return (replace(line, refused=pulse) if reason else replace(line, open=pulse)), reason
    return Line(line.open, pulse, line.last, line.refused), ""


def _withdraw(line: Line, open_ns: i64, now_ns: i64) -> Line:
    """Take back the pulse with that opening: drop it, or close it now if it is open."""
    if line.pending is not None and line.pending.open_ns == open_ns:
        return replace(line, pending=None)
    if line.open is not None and line.open.open_ns == open_ns:
        return replace(line, open=_closed(line.open, now_ns))
    return line


def _closed(pulse: Pulse | None, now_ns: i64) -> Pulse | None:
    """Return an open pulse, if there is one, as it is when it ends now."""
    return pulse and Pulse(pulse.order, pulse.open_ns, min(pulse.close_ns, now_ns))


def _objection(line: Line, pulse: Pulse, now_ns: i64, moves: bool) -> str:
    """Tell why a pulse is refused; an empty string when it is not.

    moves: it is the open pulse with another closing, which has to lie ahead, and before what is to
    come on the line
    """
    if pulse.order.duration_us > LONGEST_US[KINDS[pulse.order.channel]]:
        return TOO_LONG
    if pulse.open_ns - now_ns > FURTHEST_US * 1000:
        return TOO_FAR_AHEAD
    if not moves:
        if line.open is not None and pulse.open_ns < line.open.close_ns:
            return OVERLAP
        return LATE if pulse.open_ns < now_ns else ""
    if pulse.close_ns < now_ns:
        return LATE
    pending = line.pending
    return OVERLAP if pending is not None and pending.open_ns < pulse.close_ns else ""


def _counted(counts: tuple[int, ...], reason: str) -> tuple[int, ...]:
    index = REASONS.index(reason)
    return (*counts[:index], counts[index] + 1, *counts[index + 1 :])


def _next_edge(lines: list[Line]) -> i64:
    """Find the next instant at which a line changes level."""
    edge: i64 = NEVER
    for line in lines:
        if line.open is not None:
            edge = min(edge, line.open.close_ns)
        elif line.pending is not None:
            edge = min(edge, line.pending.open_ns)
    return edge


def shut(table: PulseTable, now_ns: i64) -> PulseTable:
    """Let what is open close now, and drop what is to come."""
    if table.next_edge_ns == NEVER:
        return table
    lines = [Line(_closed(line.open, now_ns), None, line.last, line.refused)
             for line in table.lines]  # fmt: skip
    return PulseTable(tuple(lines), _next_edge(lines), table.refusals)


def advance(table: PulseTable, to_ns: float) -> tuple[PulseTable, tuple[Edge, ...]]:
    """Let time pass; returns the table, and every edge up to and at `to_ns` in time order."""
    due_ns = table.next_edge_ns
    if float(due_ns) > to_ns:
        return table, _NO_EDGES
    lines = list(table.lines)
    edges: list[Edge] = []
    while float(due_ns) <= to_ns:
        for channel, line in enumerate(lines):
            running, pending = line.open, line.pending
            if running is not None:
                if running.close_ns <= due_ns:
                    lines[channel] = Line(None, pending, running, line.refused)
                    edges.append(Edge(running.close_ns, channel, False, running))
            elif pending is not None and pending.open_ns <= due_ns:
                lines[channel] = Line(pending, None, line.last, line.refused)
                edges.append(Edge(pending.open_ns, channel, True, pending))
        due_ns = _next_edge(lines)
    return PulseTable(tuple(lines), due_ns, table.refusals), tuple(edges)
