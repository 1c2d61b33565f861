"""Valve edges of both cylinders: where they belong, when they are ordered, what the delay is.

An edge is ordered so long before its position that the valve moves there. How long that is is
learnt: the position switches tell when a valve has moved.

    delay += g (t_moved - t_edge - delay),   g = 1/n down to the configured gain
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.timing.plan import US, PlannedPulse, Timings, whole_us
from controller.timing.stations import Passage, follow, instant, sine_profile
from controller.timing.valve_table import ValveTable
from hil.rounding import nearest
from hil.values import NEVER, Value, replace
from hil.wire.messages import VALVES, ValveMove
from hil.wire.pulses import LONGEST_US, VALVE, unwrap_ns

STEP_NS: Final = 10_000
"""A correction smaller than this is not worth a frame: 30 um at the greatest speed."""

_FINER: Final = 64
"""Of what is still far ahead, a change of this part of the time to go is not worth one either."""

SHORTEST_NS: Final[i64] = 500_000
_SAME_NS: Final[i64] = 5_000_000
"""Predictions that differ by less are of one and the same crossing."""

_LONGEST_NS: Final[i64] = LONGEST_US[VALVE] * US
_FURTHEST_NS: Final[i64] = 200_000_000
_FIRST: Final[i64] = VALVES[0]


@final
class Learnt(Value):
    """What is known of one edge's delay: it [ns], and from how many moves."""

    __slots__ = ("delay_ns", "count")

    def __init__(self, delay_ns: float, count: int = 0) -> None:
        self.delay_ns = delay_ns
        self.count = count


@final
class Opening(Value):
    """One opening of a valve: when piston and valve are to meet, and what is ordered for it.

    sent: the order as the plant was last sent it, None while it has not been
    before: that of the opening before this one
    """

    __slots__ = ("opens_ns", "closes_ns", "pulse", "sent", "before")

    def __init__(
        self, opens_ns: i64, closes_ns: i64, pulse: PlannedPulse, sent: PlannedPulse | None,
        before: PlannedPulse | None,
    ) -> None:  # fmt: skip
        self.opens_ns = opens_ns
        self.closes_ns = closes_ns
        self.pulse = pulse
        self.sent = sent
        self.before = before


@final
class ValveTiming(Value):
    """The piston's passage, the delay of each edge, and each valve's next or present opening.

    sent: orders of other lines that the plant has been sent
    """

    __slots__ = ("passage", "learnt", "openings", "sent")

    def __init__(
        self, passage: Passage, learnt: tuple[Learnt, ...], openings: tuple[Opening | None, ...],
        sent: tuple[PlannedPulse, ...] = (),
    ) -> None:  # fmt: skip
        self.passage = passage
        self.learnt = learnt
        self.openings = openings
        self.sent = sent


def initial(table: ValveTable, amplitude_m: float, stroke_s: float, running: bool) -> ValveTiming:
    """Before the first sample: strokes of a steady oscillation, delays as configured."""
    lasts_s = table.stroke_s or (stroke_s,) * table.phases
    profiles = tuple([sine_profile(table.stations_m, amplitude_m, s) for s in lasts_s])
    begun_ns = 0 if running else -1
    passage = Passage(table.first, begun_ns, amplitude_m, (), (), profiles)
    learnt = tuple([
        Learnt(table.opening_ns if edge.opens else table.closing_ns) for edge in table.edges
    ])  # fmt: skip
    return ValveTiming(passage, learnt, (None,) * len(VALVES))


def observe(
    table: ValveTable, timing: ValveTiming, before: Motion, after: Motion, dead_centre: bool,
    moved: ValveMove | None,
) -> ValveTiming:  # fmt: skip
    """Take a sample, and what the position switches say, into what is known.

    Parameters: before, after : motion at the sample before and at this one
    """
    old, learnt = timing.passage, timing.learnt
    passage = follow(table.stations_m, _begun(table, old, after), before, after, dead_centre)
    if moved is not None:
        learnt = _told(table, timing, moved, after.t_ns)
    if passage is old and learnt is timing.learnt:
        return timing
    return ValveTiming(passage, learnt, timing.openings, timing.sent)


def _begun(table: ValveTable, passage: Passage, after: Motion) -> Passage:
    """A piston that sets off from rest begins a stroke; even phases go to the right."""
    if passage.begun_ns >= 0 or after.direction == 0:
        return passage
    phase = passage.phase
    if (phase % 2 == 0) != (after.direction > 0):
        phase = (phase + 1) % table.phases
    return replace(passage, phase=phase, begun_ns=after.t_ns, start_m=-after.z_m)


def _told(
    table: ValveTable, timing: ValveTiming, moved: ValveMove, now_ns: i64
) -> tuple[Learnt, ...]:
    """Learn from a valve that has moved how long it took."""
    line, opens = int(moved.channel - _FIRST), bool(moved.is_open)
    opening = timing.openings[line]
    number, moved_ns = table.edge_of(line, opens), unwrap_ns(moved.t_us, now_ns)
    ordered_ns = _ordered(opening, opens, moved_ns, table.most_ns)
    if ordered_ns < 0:
        return timing.learnt
    learnt = list(timing.learnt)
    learnt[number] = _learn(table, learnt[number], float(moved_ns - ordered_ns))
    return tuple(learnt)


def _ordered(opening: Opening | None, opens: bool, moved_ns: i64, most_ns: float) -> i64:
    """The edge that a move follows, of this opening or the one before it; -1 none that may be."""
    told: list[PlannedPulse | None] = [] if opening is None else [opening.sent, opening.before]
    for pulse in told:
        if pulse is None:
            continue
        edge_ns = pulse.open_ns if opens else pulse.close_ns
        if 0.0 <= float(moved_ns - edge_ns) <= most_ns:
            return edge_ns
    return -1


def _learn(table: ValveTable, edge: Learnt, took_ns: float) -> Learnt:
    """Let a move correct its delay."""
    gain = max(1.0 / float(edge.count + 1), table.gain)
    return Learnt(edge.delay_ns + gain * (took_ns - edge.delay_ns), edge.count + 1)


def plan(
    table: ValveTable, timings: Timings, timing: ValveTiming, t_ns: i64, period_ns: i64
) -> ValveTiming:
    """Place the next opening of each valve, and move what may still be moved."""
    if timing.passage.begun_ns < 0 or not (table.at_once or timing.passage.is_seen):
        return timing
    acts_ns = t_ns + timings.act_ticks * period_ns
    openings = tuple([
        _placed(table, timing, line, opening, acts_ns)
        for line, opening in enumerate(timing.openings)
    ])  # fmt: skip
    return replace(timing, openings=openings)


def _placed(
    table: ValveTable, timing: ValveTiming, line: int, old: Opening | None, acts_ns: i64
) -> Opening:
    """One valve: its opening ahead, or under way, by the newest prediction.

    What the plant has been sent and does by then is done; what it has not can still be anything.
    """
    told = None if old is None else old.sent
    if old is None or (told is not None and told.close_ns <= acts_ns):
        return _next_opening(table, timing, line, old, acts_ns)
    opens, closes = table.edge_of(line, True), table.edge_of(line, False)
    if told is not None and told.open_ns <= acts_ns:
        open_ns, opens_ns = told.open_ns, old.opens_ns
    else:
        opens_ns = _when(table, timing.passage, opens, old.opens_ns - _SAME_NS)
        open_ns = _order(opens_ns, timing.learnt[opens], acts_ns, old.pulse.open_ns)
    closes_ns = _when(table, timing.passage, closes, opens_ns)
    close_ns = _order(closes_ns, timing.learnt[closes], acts_ns, old.pulse.close_ns)
    pulse = _pulse(line, open_ns, close_ns, old.pulse)
    return Opening(opens_ns, closes_ns, pulse, old.sent, old.before)


def _next_opening(
    table: ValveTable, timing: ValveTiming, line: int, old: Opening | None, acts_ns: i64
) -> Opening:
    """The opening that follows one that is over."""
    opens, closes = table.edge_of(line, True), table.edge_of(line, False)
    opens_ns = _when(table, timing.passage, opens, acts_ns if old is None else old.closes_ns)
    closes_ns = _when(table, timing.passage, closes, opens_ns)
    open_ns = _order(opens_ns, timing.learnt[opens], acts_ns, -1)
    close_ns = _order(closes_ns, timing.learnt[closes], acts_ns, -1)
    pulse = _pulse(line, open_ns, close_ns, None)
    return Opening(opens_ns, closes_ns, pulse, None, None if old is None else old.sent)


def _when(table: ValveTable, passage: Passage, number: int, after_ns: i64) -> i64:
    """When the piston is where an edge belongs, the first time after an instant [ns]."""
    edge = table.edges[number]
    lead_ns: i64 = table.lead_ns if edge.station < 0 else 0
    return instant(passage, edge.phase, edge.station, after_ns + lead_ns) - lead_ns


def _order(there_ns: i64, learnt: Learnt, acts_ns: i64, old_ns: i64) -> i64:
    """When the line is to change so that the valve moves there; an old order that is as good."""
    wanted_ns = max(whole_us(there_ns - nearest(learnt.delay_ns)), whole_us(acts_ns))
    step_ns: i64 = STEP_NS + (wanted_ns - acts_ns) // _FINER
    return old_ns if -step_ns < wanted_ns - old_ns < step_ns else wanted_ns


def _pulse(line: int, open_ns: i64, close_ns: i64, old: PlannedPulse | None) -> PlannedPulse:
    """The pulse between two edges, which is the old one where nothing has changed."""
    lasts_ns = min(max(close_ns - open_ns, SHORTEST_NS), _LONGEST_NS)
    if old is not None and old.open_ns == open_ns and old.duration_ns == lasts_ns:
        return old
    return PlannedPulse(_FIRST + line, open_ns, lasts_ns)


def to_send(
    timing: ValveTiming, pulses: tuple[PlannedPulse, ...], tick: i64, acts_ns: i64, most: i64
) -> tuple[ValveTiming, tuple[PlannedPulse, ...]]:
    """Choose the orders of a tick.

    New ones of injectors and sparks, then what the plant knows worst of the valves, then the others
    in turn, so that one lost frame costs nothing.

    Parameters: pulses : of injectors and sparks; most : frames that there is room for
    """
    sent = [*timing.sent, *[o.sent for o in timing.openings if o is not None and o.sent]]
    near = [o.pulse for o in timing.openings if o is not None and _is_near(o, acts_ns)]
    new = [pulse for pulse in near if not _is_in(pulse, sent)]
    new.sort(key=lambda pulse: _how_wrong(pulse, sent), reverse=True)
    first = [pulse for pulse in pulses if not _is_in(pulse, sent)]
    known = [pulse for pulse in (*pulses, *near) if _is_in(pulse, sent)]
    turn = int(tick) % len(known) if known else 0
    chosen = [*first, *new, *known[turn:], *known[:turn]][: int(most)]
    openings = tuple([_with_sent(opening, chosen) for opening in timing.openings])
    still = tuple([p for p in pulses if _is_in(p, sent) or _is_in(p, chosen)])
    return ValveTiming(timing.passage, timing.learnt, openings, still), tuple(chosen)


def _is_near(opening: Opening, acts_ns: i64) -> bool:
    return opening.pulse.open_ns < acts_ns + _FURTHEST_NS


def _with_sent(opening: Opening | None, chosen: list[PlannedPulse]) -> Opening | None:
    """The opening, once its pulse is among those that are sent."""
    if opening is None or opening.sent is opening.pulse or not _is_in(opening.pulse, chosen):
        return opening
    pulse = opening.pulse
    return Opening(opening.opens_ns, opening.closes_ns, pulse, pulse, opening.before)


def _is_in(pulse: PlannedPulse, pulses: list[PlannedPulse]) -> bool:
    return any(pulse is one for one in pulses)


def _how_wrong(pulse: PlannedPulse, sent: list[PlannedPulse]) -> i64:
    """By how much the plant's order of a line differs from this one [ns]."""
    for old in sent:
        if old.channel == pulse.channel:
            first_ns, last_ns = pulse.open_ns - old.open_ns, pulse.close_ns - old.close_ns
            return max(first_ns, -first_ns) + max(last_ns, -last_ns)
    return NEVER


def at_rest(timing: ValveTiming) -> ValveTiming:
    """The same with nothing ordered: in this mode no line may be high."""
    return ValveTiming(timing.passage, timing.learnt, (None,) * len(VALVES))
