"""Which valve moves where, in which stroke of the cycle (thesis Tables 3.1 and 3.3)."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.config.timing import ValvesKnowledge
from hil.values import Value
from hil.wire.messages import EXHAUST_LEFT, EXHAUST_RIGHT, INTAKE_LEFT, INTAKE_RIGHT, VALVES

AT_START: Final = -1
"""Instead of a station: the dead centre that begins the stroke."""

_MARKS_M: Final = (-10.0e-3, -6.0e-3, -3.0e-3, 0.0, 3.0e-3, 6.0e-3, 10.0e-3)
"""Stations beside those of the edges, by which a stroke is known."""


@final
class ValveEdge(Value):
    """One edge: in which stroke of the cycle, even ones going to the right, at which station.

    line: valve, counted from the first valve's channel
    """

    __slots__ = ("phase", "station", "line", "opens")

    def __init__(self, phase: int, station: int, line: int, opens: bool) -> None:
        self.phase = phase
        self.station = station
        self.line = line
        self.opens = opens


@final
class ValveTable(Value):
    """All edges, the stations that they are at, and what is believed of the actuators.

    phases: strokes of a cycle; first: the one with which a running engine begins
    most_ns: the longest delay that is believed
    at_once: whether valves are moved from the first stroke on; an engine that is running already is
        watched for a cycle first
    lead_ns: how long before a dead centre the edges that belong to it are
    stroke_s: duration of each stroke until it has been seen, none where all last as long
    """

    __slots__ = (
        "edges", "stations_m", "phases", "first", "opening_ns", "closing_ns", "gain", "most_ns",
        "stroke_s", "lead_ns", "at_once",
    )  # fmt: skip

    def __init__(
        self, edges: tuple[ValveEdge, ...], stations_m: tuple[float, ...], phases: int, first: int,
        opening_ns: float, closing_ns: float, gain: float, most_ns: float,
        stroke_s: tuple[float, ...], lead_ns: i64,
        at_once: bool,
    ) -> None:  # fmt: skip
        self.edges = edges
        self.stations_m = stations_m
        self.phases = phases
        self.first = first
        self.opening_ns = opening_ns
        self.closing_ns = closing_ns
        self.gain = gain
        self.most_ns = most_ns
        self.stroke_s = stroke_s
        self.lead_ns = lead_ns
        self.at_once = at_once

    def edge_of(self, line: int, opens: bool) -> int:
        """The number of a valve's edge; every valve has one that opens and one that closes."""
        return 2 * line + (0 if opens else 1)


Place = tuple[int, float | None, int, bool]
"""Stroke of the cycle, position in the direction of motion (None: its start), channel, opens."""


def table_of(config: ValvesKnowledge, half_stroke_m: float, at_once: bool) -> ValveTable:
    """Make the table of a cycle.

    Two-stroke: the cylinder behind the piston opens, the one ahead closes, by distance from its
    head (Table 3.3). Four-stroke: at the dead centres that begin its strokes (Table 3.1).
    """
    two = config.cycle == "two-stroke"
    places = _two_stroke(config, half_stroke_m) if two else _four_stroke()
    own = {z for _, z, _, _ in places if z is not None}
    near = [z for z in _MARKS_M if abs(z) < half_stroke_m and all(abs(z - o) > 1e-3 for o in own)]
    stations = tuple(sorted((*own, *near)))
    edges = [
        ValveEdge(phase, AT_START if z is None else stations.index(z), channel - VALVES[0], opens)
        for phase, z, channel, opens in places
    ]
    edges.sort(key=lambda edge: (edge.line, not edge.opens))
    return ValveTable(
        tuple(edges), stations, 2 if two else 4, config.first_stroke,
        config.opening_delay_s * 1e9, config.closing_delay_s * 1e9,
        config.gain, config.delay_max_s * 1e9, _durations(config),
        round(config.dead_centre_lead_s * 1e9), at_once,
    )  # fmt: skip


def _durations(config: ValvesKnowledge) -> tuple[float, ...]:
    """Durations as configured, those of the strokes in the order of the table."""
    count, first = len(config.stroke_s), config.first_stroke
    return tuple([config.stroke_s[(phase - first) % count] for phase in range(count)])


def _two_stroke(config: ValvesKnowledge, half_m: float) -> tuple[Place, ...]:
    behind = ((INTAKE_LEFT, EXHAUST_LEFT), (INTAKE_RIGHT, EXHAUST_RIGHT))
    places: list[Place] = []
    for phase in (0, 1):
        (intake, exhaust), (intake_ahead, exhaust_ahead) = behind[phase], behind[1 - phase]
        places += [
            (phase, config.exhaust_opens_m - half_m, exhaust, True),
            (phase, config.intake_opens_m - half_m, intake, True),
            (phase, half_m - config.intake_closes_m, intake_ahead, False),
            (phase, half_m - config.exhaust_closes_m, exhaust_ahead, False),
        ]
    return tuple(places)


def _four_stroke() -> tuple[Place, ...]:
    """Table 3.1: left takes in, compresses, works, exhausts; the right one a stroke behind."""
    return (
        (0, None, EXHAUST_LEFT, False), (0, None, INTAKE_LEFT, True),
        (0, None, EXHAUST_RIGHT, True), (1, None, INTAKE_LEFT, False),
        (1, None, EXHAUST_RIGHT, False), (1, None, INTAKE_RIGHT, True),
        (2, None, INTAKE_RIGHT, False), (3, None, EXHAUST_LEFT, True),
    )  # fmt: skip
