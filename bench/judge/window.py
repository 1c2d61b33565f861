"""One expectation in one run: from when to when it holds, and how that is told."""

from __future__ import annotations

from typing import Any, NamedTuple

from bench.judge.figures import RunData
from hil.config.suite.expectation import Expectation
from hil.values import NEVER

Judged = tuple[Any, bool, str]
"""What was found, whether that is as expected, and both in words."""


class Window(NamedTuple):
    """The stretch of a run that is judged [ns].

    origin_ns: instant of the event, or the start of the run; start_ns: the beginning; end_ns: the
    end, NEVER where it is that of the run
    """

    origin_ns: int
    start_ns: int
    end_ns: int

    def holds(self, t_ns: float) -> bool:
        """Whether an instant lies in it."""
        return self.start_ns <= t_ns <= self.end_ns


class Case(NamedTuple):
    """What a check is made of: the run, the expectation, and its window."""

    data: RunData
    expectation: Expectation
    window: Window

    def instants_ns(self, event: str) -> list[int]:
        """Return when an event happened within the window."""
        return [t_ns for t_ns in self.data.occurrences(event) if self.window.holds(t_ns)]


def window_of(data: RunData, expectation: Expectation) -> Window | None:
    """Return the window of an expectation; None when its event did not happen."""
    origin_ns = data.instant_ns(expectation.event)
    if origin_ns is None:
        return None
    start_ns = origin_ns + round(expectation.from_s * 1e9)
    ends = [NEVER]
    if expectation.until_s is not None:
        ends.append(origin_ns + round(expectation.until_s * 1e9))
    if expectation.until_event is not None:
        ends += [t_ns for t_ns in data.occurrences(expectation.until_event) if t_ns >= start_ns]
    return Window(origin_ns, start_ns, min(ends))


def superseded_ns(case: Case) -> int:
    """Return when the scenario's next set point takes the place of the one that is judged."""
    window = case.window
    later = (
        instant.t_ns
        for instant in case.data.instants
        if instant.kind == "set-point" and instant.t_ns is not None
        and instant.t_ns > window.origin_ns
    )  # fmt: skip
    return min((window.end_ns, *later))


def origin_told(expectation: Expectation) -> str:
    """Say in words what times count from."""
    return f"after {expectation.event}" if expectation.event else "after the start"


def told(expectation: Expectation, after_s: float = 0.0) -> str:
    """Say in words from when to when an expectation holds, which may have a later beginning."""
    begin_s = expectation.from_s + after_s
    origin = f" {origin_told(expectation)}"
    if begin_s:
        begin = f" from {_seconds(begin_s)}{origin} on"
    else:
        begin = f" from {expectation.event} on" if expectation.event else ""
    if expectation.until_s is not None:
        begin += f" until {_seconds(expectation.until_s)}{origin}"
    if expectation.until_event is not None:
        begin += f" until {expectation.until_event}"
    return begin or " throughout"


def _seconds(value_s: float) -> str:
    return f"{value_s * 1e3:g} ms" if value_s < 1.0 else f"{value_s:g} s"
