"""Disturbances: what the scenario does to the engine, and when (thesis section 5.3).

An edge waits for the first stroke that starts at or after its time. There it becomes due: at
once, or after a fraction of the duration which that stroke would have if left alone.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.config.engine.models import DETAILED_MODELS
from hil.config.plant import PlantConfig
from hil.values import Value, replace
from hil.wire.commands import TimedCommand

LOAD_SCALE: Final = 1
EFFICIENCY: Final = 2
MISFIRE: Final = 4
SENSOR_FAULT: Final = 8

PRE_IGNITION: Final = "pre-ignition"

_NEVER: Final = float("inf")


@final
class Edge(Value):
    """The beginning or the end of one event."""

    __slots__ = ("at_ns", "fraction", "event", "begins")

    def __init__(self, at_ns: i64, fraction: float, event: int, begins: bool) -> None:
        self.at_ns = at_ns
        self.fraction = fraction
        self.event = event
        self.begins = begins


@final
class Due(Value):
    """An edge with its instant, in seconds from the start of the stroke under way."""

    __slots__ = ("tau_s", "event", "begins")

    def __init__(self, tau_s: float, event: int, begins: bool) -> None:
        self.tau_s = tau_s
        self.event = event
        self.begins = begins


@final
class Held(Value):
    """The piston as last sampled before a fault began, and the slow signal that the fault is of."""

    __slots__ = ("x_m", "v_m_s", "slow")

    def __init__(self, x_m: float, v_m_s: float, slow: float = 0.0) -> None:
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.slow = slow


@final
class Disturbances(Value):
    """What is in force and what is still to come."""

    __slots__ = (
        "next_edge", "due", "due_s", "active", "load_scale", "efficiency", "misfires",
        "misfire_cause", "misfired", "faults",
    )  # fmt: skip

    def __init__(
        self,
        next_edge: int = 0,
        due: tuple[Due, ...] = (),
        due_s: float = _NEVER,
        active: tuple[int, ...] = (),
        load_scale: float = 1.0,
        efficiency: tuple[float, float] | None = None,
        misfires: int = 0,
        misfire_cause: str = "",
        misfired: bool = False,
        faults: tuple[tuple[int, Held], ...] = (),
    ) -> None:
        self.next_edge = next_edge
        self.due = due
        self.due_s = due_s
        self.active = active
        self.load_scale = load_scale
        self.efficiency = efficiency
        self.misfires = misfires
        self.misfire_cause = misfire_cause
        self.misfired = misfired
        self.faults = faults

    @property
    def mask(self) -> int:
        """Bits: 1 load scaled, 2 efficiency varies, 4 misfire forced, 8 sensor fault."""
        return (
            (LOAD_SCALE if self.load_scale != 1.0 else 0)
            | (EFFICIENCY if self.efficiency is not None else 0)
            | (MISFIRE if self.misfired else 0)
            | (SENSOR_FAULT if self.faults else 0)
        )


def compile_edges(events: tuple[TimedCommand, ...]) -> tuple[Edge, ...]:
    """Turn events into edges in order of time; ends come before beginnings."""
    edges = []
    for index, event in enumerate(events):
        fraction = event.number("at_stroke_fraction")
        edges.append(Edge(_ns(event.at_s), fraction, index, True))
        until_s = event.command.number("until_s")
        if until_s is not None:
            edges.append(Edge(_ns(until_s), fraction, index, False))
    return tuple(sorted(edges, key=lambda edge: (edge.at_ns, edge.begins, edge.event)))


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)


_NO_EDGES: Final[tuple[Edge, ...]] = ()


def start_stroke(
    edges: tuple[Edge, ...], state: Disturbances, t_ns: i64, elapsed_s: float
) -> tuple[Disturbances, tuple[Edge, ...]]:
    """Count the dues from the new stroke, and take the edges that this stroke is the first for.

    Parameters: elapsed_s : float, duration of the stroke that has just ended [s]
    """
    last = state.next_edge
    if not state.due and (last == len(edges) or edges[last].at_ns > t_ns):
        return state, _NO_EDGES
    while last < len(edges) and edges[last].at_ns <= t_ns:
        last += 1
    taken = edges[state.next_edge : last]
    due = tuple(Due(max(d.tau_s - elapsed_s, 0.0), d.event, d.begins) for d in state.due)
    return replace(state, next_edge=last, due=due, due_s=_first(due)), taken


def put(state: Disturbances, due: Due) -> Disturbances:
    """Enter an edge at its instant."""
    entries = tuple(sorted((*state.due, due), key=lambda d: d.tau_s))
    return replace(state, due=entries, due_s=_first(entries))


def pop(state: Disturbances) -> tuple[Disturbances, Due]:
    """Take the edge that is due first."""
    rest = state.due[1:]
    return replace(state, due=rest, due_s=_first(rest)), state.due[0]


def _first(due: tuple[Due, ...]) -> float:
    return due[0].tau_s if due else _NEVER


def apply(
    events: tuple[TimedCommand, ...], state: Disturbances, due: Due, held: Held
) -> Disturbances:
    """Begin or end one event; among events of a kind the one begun last counts."""
    event = events[due.event]
    if event.kind == "misfire":
        misfires = state.misfires + int(event.number("count"))
        return replace(state, misfires=misfires, misfire_cause=event.text("cause"))
    if event.kind == "sensor-fault":
        return _apply_fault(event, state, due, held)
    if event.kind == PRE_IGNITION:
        return state
    active = tuple(index for index in state.active if index != due.event)
    if due.begins:
        active = (*active, due.event)
    scale, efficiency = 1.0, None
    for index in active:
        current = events[index]
        if current.kind == "load-scale":
            scale = current.number("value")
        elif current.kind == "efficiency":
            efficiency = (current.number("low"), current.number("high"))
    return replace(state, active=active, load_scale=scale, efficiency=efficiency)


def _apply_fault(event: TimedCommand, state: Disturbances, due: Due, held: Held) -> Disturbances:
    faults = tuple(fault for fault in state.faults if fault[0] != due.event)
    if not due.begins:
        return replace(state, faults=faults)
    state = replace(state, faults=(*faults, (due.event, held)))
    return put(state, Due(due.tau_s + event.number("duration_s"), due.event, False))


def take_misfire(state: Disturbances) -> tuple[Disturbances, str]:
    """Use up one forced misfire, if there is one: its cause, or an empty string."""
    if not state.misfires:
        return (replace(state, misfired=False) if state.misfired else state), ""
    return replace(state, misfires=state.misfires - 1, misfired=True), state.misfire_cause


def alight(state: Disturbances, event: int) -> Disturbances:
    """A charge has caught fire by itself, until its dead centre."""
    return replace(state, active=(*state.active, event))


def is_alight(events: tuple[TimedCommand, ...], state: Disturbances) -> bool:
    """Whether the charge ahead has caught fire by itself."""
    return any(events[index].kind == PRE_IGNITION for index in state.active)


def burnt_out(events: tuple[TimedCommand, ...], state: Disturbances) -> Disturbances:
    """The next charge is another one."""
    if not state.active or not is_alight(events, state):
        return state
    active = tuple(index for index in state.active if events[index].kind != PRE_IGNITION)
    return replace(state, active=active)


def preview(
    edges: tuple[Edge, ...], events: tuple[TimedCommand, ...], d: Disturbances, until_ns: i64
) -> Disturbances:
    """Disturbances as they are at a dead centre before `until_ns`, if one should come."""
    if d.next_edge >= len(edges) or edges[d.next_edge].at_ns > until_ns:
        return d
    d, taken = start_stroke(edges, d, until_ns, 0.0)
    for edge in taken:
        if edge.fraction == 0.0:
            d = apply(events, d, Due(0.0, edge.event, edge.begins), Held(0.0, 0.0))
    return d


def objection(config: PlantConfig) -> str:
    """Tell which disturbance finds nothing to disturb; an empty string when none."""
    if config.disturbance.exhaust_late_s > 0.0 and config.valves.moved_by != "lines":
        return (
            "plant.disturbance.exhaust_late_s: no line moves a valve; accepted with"
            " controller.timing.valves = controller"
        )
    return ""


def objection_to(config: PlantConfig, kind: str) -> str:
    """Tell why a fault of that kind would do nothing to this plant; an empty string when it would.

    An engine of the user's may do with its charges as it likes.
    """
    if kind != PRE_IGNITION or config.own.file or config.model in DETAILED_MODELS:
        return ""
    if config.model == "fmu":
        return f"{kind}: a unit lights its charges of its own; accepted on the other models"
    if config.ignition.work == "map":
        return ""
    return (
        f"{kind}: on model {config.model} the work is the same whenever a charge is lit; accepted"
        f" with plant.ignition.work = map, or on {', '.join(DETAILED_MODELS)}"
    )
