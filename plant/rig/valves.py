"""Valves between their TTL lines and the gas: an actuator's delay, its spread, the piston's crown.

An edge of a line moves its valve a delay later, which differs from one move to the next. What the
valve has done is told once, by a position switch, in the sample of the tick after it.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.config.plant import ValvesConfig
from hil.randoms import VALVE, normal_pair
from hil.rounding import nearest
from hil.values import NEVER, Value
from hil.wire.messages import CHANNELS, EXHAUST_LEFT, EXHAUST_RIGHT, VALVES
from hil.wire.pulses import Edge

_FIRST: Final[i64] = VALVES[0]
_EXHAUSTS: Final = (EXHAUST_LEFT, EXHAUST_RIGHT)
_MOST_DEVIATIONS: Final = 3.0
"""A draw beyond three standard deviations is one of three: no valve moves before its edge."""


@final
class ValveActuators(Value):
    """What moves the valves: delays [ns], their standard deviation [ns], and what is in the way.

    by_lines: whether a controller moves the valves: the piston's programme is off, but for the
        settled motion in which a run may begin, where each valve keeps to it until its first pulse
    clearance_m: gap between piston and head below which an open valve is struck
    exhaust_late_ns: what opens an exhaust valve is so much slower
    """

    __slots__ = (
        "opening_ns", "closing_ns", "spread_ns", "seed", "by_lines", "clearance_m",
        "exhaust_late_ns",
    )  # fmt: skip

    def __init__(
        self, opening_ns: i64, closing_ns: i64, spread_ns: float, seed: int, by_lines: bool,
        clearance_m: float, exhaust_late_ns: i64 = 0,
    ) -> None:  # fmt: skip
        self.opening_ns = opening_ns
        self.closing_ns = closing_ns
        self.spread_ns = spread_ns
        self.seed = seed
        self.by_lines = by_lines
        self.clearance_m = clearance_m
        self.exhaust_late_ns = exhaust_late_ns


IDEAL: Final = ValveActuators(0, 0, 0.0, 0, False, 0.0)
"""A valve moves with its line."""


def actuators_of(
    config: ValvesConfig, seed: int, lift_m: float, exhaust_late_s: float
) -> ValveActuators:
    """Flatten section `valves` of a plant's configuration, and what disturbs them."""
    return ValveActuators(
        round(config.opening_s * 1e9), round(config.closing_s * 1e9), config.deviation_s * 1e9,
        seed, config.moved_by == "lines", max(lift_m - config.pocket_m, 0.0),
        late_ns(exhaust_late_s),
    )  # fmt: skip


def late_ns(late_s: float) -> i64:
    """A delay in nanoseconds."""
    return nearest(late_s * 1e9)


@final
class Move(Value):
    """A valve that opens or closes at an instant; `line` counts from the first valve's channel."""

    __slots__ = ("t_ns", "line", "is_open")

    def __init__(self, t_ns: i64, line: i64, is_open: bool) -> None:
        self.t_ns = t_ns
        self.line = line
        self.is_open = is_open

    @property
    def name(self) -> str:
        """The name of the valve's line."""
        return CHANNELS[_FIRST + self.line]


@final
class Valves(Value):
    """Levels of the valves that have been moved by their lines, -1 of one that has not been yet.

    moves: ordered and still to come, in order of time; count: edges so far
    told: moves that have been made and wait to be told, the oldest first; struck: by the piston
    """

    __slots__ = ("levels", "moves", "count", "told", "struck")

    def __init__(
        self, levels: tuple[int, ...] = (-1, -1, -1, -1), moves: tuple[Move, ...] = (),
        count: i64 = 0, told: tuple[Move, ...] = (), struck: int = 0,
    ) -> None:  # fmt: skip
        self.levels = levels
        self.moves = moves
        self.count = count
        self.told = told
        self.struck = struck

    @property
    def next_ns(self) -> i64:
        """When the next valve moves."""
        return self.moves[0].t_ns if self.moves else NEVER


UNUSED: Final = Valves()
SHUT: Final = Valves((0, 0, 0, 0))
"""Valves that only their lines can open."""


def ordered(valves: Valves, actuators: ValveActuators, edge: Edge) -> Valves:
    """Let an edge of a line move its valve a delay later.

    t = t_edge + delay + spread * z, z standard normal within three deviations; a valve that is told
    to close before it has begun to open stays shut.
    """
    delay_ns = actuators.opening_ns if edge.high else actuators.closing_ns
    if edge.high and edge.channel in _EXHAUSTS:
        delay_ns += actuators.exhaust_late_ns
    if actuators.spread_ns > 0.0:
        z = normal_pair(actuators.seed, VALVE, valves.count)[0]
        z = min(max(z, -_MOST_DEVIATIONS), _MOST_DEVIATIONS)
        delay_ns = max(delay_ns + nearest(actuators.spread_ns * z), 0)
    move = Move(edge.t_ns + delay_ns, edge.channel - _FIRST, edge.high)
    kept = [m for m in valves.moves if m.line != move.line or m.t_ns < move.t_ns]
    moves = tuple(sorted((*kept, move), key=lambda m: m.t_ns))
    return Valves(valves.levels, moves, valves.count + 1, valves.told, valves.struck)


def moved(valves: Valves, to_ns: float) -> Valves:
    """Make every move that is due by `to_ns`."""
    if float(valves.next_ns) > to_ns:
        return valves
    levels, told = list(valves.levels), list(valves.told)
    waiting = list(valves.moves)
    while waiting and float(waiting[0].t_ns) <= to_ns:
        move = waiting.pop(0)
        if levels[move.line] != int(move.is_open):
            told.append(move)
        levels[move.line] = int(move.is_open)
    return Valves(tuple(levels), tuple(waiting), valves.count, tuple(told), valves.struck)


def after_telling(valves: Valves) -> Valves:
    """The valves once the sample of a tick has told of the oldest move."""
    if not valves.told:
        return valves
    return Valves(valves.levels, valves.moves, valves.count, valves.told[1:], valves.struck)


def strike(valves: Valves, actuators: ValveActuators, gaps_m: tuple[float, float]) -> int:
    """Tell which open valves the piston touches, a bit a valve.

    Parameters: gaps_m : distance of the piston from the left and from the right head
    """
    struck = 0
    for line, level in enumerate(valves.levels):
        if level == 1 and gaps_m[line // 2] < actuators.clearance_m:
            struck |= 1 << line
    return struck


def with_struck(valves: Valves, struck: int) -> Valves:
    """The valves with others under the piston."""
    return Valves(valves.levels, valves.moves, valves.count, valves.told, struck)


def names_of(bits: int) -> list[str]:
    """Return the names of the valves of a bit set."""
    return [CHANNELS[channel] for line, channel in enumerate(VALVES) if bits >> line & 1]
