"""What happened in a run: the events of both logs, and the instants of the scenario's own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from controller.build import schedule_of
from hil.config.resolved import Resolved
from hil.log import Log, topics
from hil.wire.commands import CONTROLLER

_MAX_KEPT = 2000
_REFUSED = "command-refused"
_BEGINNINGS = ("disturbance", "stimulus")
_JUDGED = (*_BEGINNINGS, "mode ", "safe-state", _REFUSED)
"""Codes that verdicts rest on: kept however many other lines there are."""


class Happening(NamedTuple):
    """One line of a log's /event topic."""

    t_ns: int
    source: str
    severity: str
    code: str
    text: str


class Instant(NamedTuple):
    """When an event of the scenario really acted; `t_ns` is None when it did not.

    refused: why it was not obeyed, empty when it was
    """

    name: str
    kind: str
    t_ns: int | None
    refused: str = ""


class Happenings(NamedTuple):
    """Events of both logs in order of time.

    lines: the first ones, and all that verdicts rest on; times_ns: instants of all by code
    """

    lines: tuple[Happening, ...]
    times_ns: dict[str, list[int]]
    left_out: int

    @property
    def counts(self) -> dict[str, int]:
        """How many there were of each code."""
        return {code: len(times) for code, times in self.times_ns.items()}

    def beginnings(self, name: str) -> list[int]:
        """Return when an event of the scenario acted, each time; a command that it is, later."""
        found: dict[str, list[int]] = {code: [] for code in _BEGINNINGS}
        for line in self.lines:
            if (
                line.code in found
                and line.text.startswith(f"{name} (")
                and (line.text.endswith(" begins"))
            ):
                found[line.code].append(line.t_ns)
        return found["disturbance"] or found["stimulus"]

    @property
    def refusals(self) -> tuple[Happening, ...]:
        """Orders that plant or controller refused, of the scenario or over the command key."""
        return tuple(line for line in self.lines if line.code == _REFUSED)


def read_happenings(logs: dict[str, Log]) -> Happenings:
    """Gather the events of both logs."""
    lines: list[Happening] = []
    times: dict[str, list[int]] = {}
    left_out = 0
    for source, log in logs.items():
        kept = 0
        for record in log.records("/event"):
            times.setdefault(record.code, []).append(record.t_ns)
            if kept >= _MAX_KEPT and not record.code.startswith(_JUDGED):
                left_out += 1
                continue
            kept += 1
            severity = topics.SEVERITIES[min(record.severity, topics.FAULT)]
            lines.append(Happening(record.t_ns, source, severity, record.code, record.text))
    for instants_ns in times.values():
        instants_ns.sort()
    return Happenings(tuple(sorted(lines, key=lambda line: line.t_ns)), times, left_out)


def instants(scenario: Resolved, happenings: Happenings) -> tuple[Instant, ...]:
    """Return when each event of the scenario acted, in the scenario's order.

    A disturbance begins at the instant that the plant logged; an operator's command is the
    scenario's own doing and acts in its tick, unless it was refused or the run ended before.
    """
    ordered = _ordered(scenario, happenings)
    events = [
        ordered.get(name) or Instant(name, event.kind, _first(happenings.beginnings(name)))
        for name, event in scenario.events.items()
    ]
    stimuli = [
        Instant(name, given.kind, _first(happenings.beginnings(name)))
        for name, given in scenario.stimuli.items()
    ]
    return (*events, *stimuli)


def _first(instants_ns: Sequence[int]) -> int | None:
    return instants_ns[0] if instants_ns else None


def _ordered(scenario: Resolved, happenings: Happenings) -> dict[str, Instant]:
    """The operator's commands of a scenario by name, each in the tick that it was planned for."""
    names = [n for n, event in scenario.events.items() if event.to == CONTROLLER]
    own = {r.t_ns: r.text for r in happenings.refusals if "from scenario" in r.text}
    found: dict[str, Instant] = {}
    for name, (tick, command) in zip(names, schedule_of(scenario).items(), strict=True):
        t_ns = tick * scenario.loop.period_ns
        acts = t_ns < scenario.run.duration_s * 1e9 and t_ns not in own
        found[name] = Instant(name, command.kind, t_ns if acts else None, own.get(t_ns, ""))
    return found
