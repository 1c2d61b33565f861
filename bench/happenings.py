"""What happened in a run: the events of both logs, and the instants of the scenario's own."""

from __future__ import annotations

from typing import NamedTuple

from hil import topics
from hil.config.resolved import Resolved
from hil.config.scenario import OperatorEvent
from hil.log import Log

_MAX_KEPT = 2000


class Happening(NamedTuple):
    """One line of a log's /event topic."""

    t_ns: int
    source: str
    severity: str
    code: str
    text: str


class Instant(NamedTuple):
    """When an event of the scenario really acted; `t_ns` is None when it did not."""

    name: str
    kind: str
    t_ns: int | None


class Happenings(NamedTuple):
    """Events of both logs in order of time; `counts` holds all by code, `lines` the first ones."""

    lines: tuple[Happening, ...]
    counts: dict[str, int]
    left_out: int


def read_happenings(logs: dict[str, Log]) -> Happenings:
    """Gather the events of both logs."""
    lines: list[Happening] = []
    counts: dict[str, int] = {}
    left_out = 0
    for source, log in logs.items():
        kept = 0
        for record in log.records("/event"):
            counts[record.code] = counts.get(record.code, 0) + 1
            if kept >= _MAX_KEPT:
                left_out += 1
                continue
            kept += 1
            severity = topics.SEVERITIES[min(record.severity, topics.FAULT)]
            lines.append(Happening(record.t_ns, source, severity, record.code, record.text))
    return Happenings(tuple(sorted(lines, key=lambda line: line.t_ns)), counts, left_out)


def instants(scenario: Resolved, happenings: Happenings) -> tuple[Instant, ...]:
    """Return when each event of the scenario acted, in the scenario's order.

    A disturbance begins at the instant that the plant logged; an operator's command is the
    scenario's own doing and acts at its time, unless the run ended before.
    """
    begun: dict[str, int] = {}
    for line in happenings.lines:
        name, _, rest = line.text.partition(" ")
        if line.code == "disturbance" and rest.endswith(" begins"):
            begun.setdefault(name, line.t_ns)
    return tuple(_instant(scenario, name, begun) for name in scenario.events)


def _instant(scenario: Resolved, name: str, begun: dict[str, int]) -> Instant:
    event = scenario.events[name]
    if not isinstance(event, OperatorEvent):
        return Instant(name, event.kind, begun.get(name))
    at_s = event.at_s if event.at_s < scenario.run.duration_s else None
    return Instant(name, event.kind, None if at_s is None else round(at_s * 1e9))
