"""One check for each demand of each expectation of a scenario."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from bench.judge import engine_checks, signal_checks
from bench.judge.figures import RunData
from bench.judge.signal_checks import Part
from bench.judge.traces import read_recorded
from bench.judge.window import Case, Judged, origin_told, told, window_of
from hil.config.suite.expectation import OF_A_SIGNAL, Expectation


class Check(NamedTuple):
    """One expectation with what was found; `found` is None when there was nothing to judge."""

    name: str
    key: str
    expected: Any
    found: Any
    met: bool
    text: str
    requirement: str = ""


def judge(data: RunData) -> list[Check]:
    """Hold the run against each expectation of its scenario, in the scenario's order."""
    return [
        _check(name, key, data, expectation)
        for name, expectation in data.scenario.expect.items()
        for key in _demands(expectation)
    ]


def _demands(given: Expectation) -> list[str]:
    """Keys that demand something; bounds that are to be reached in time are one demand."""
    keys = [key for key in _JUDGES if getattr(given, key) is not None]
    if given.within_s is not None:
        keys = [key for key in keys if key not in ("min", "max", "then")]
    if given.settling_s is not None:
        keys = [key for key in keys if key != "tolerance"]
    return keys


def _check(name: str, key: str, data: RunData, expectation: Expectation) -> Check:
    expected, requirement = getattr(expectation, key), expectation.requirement
    window = window_of(data, expectation)
    if window is None:
        text = f"event {expectation.event!r} did not happen"
        return Check(name, key, expected, None, False, text, requirement)
    found, met, text = _JUDGES[key](Case(data, expectation, window))
    return Check(name, key, expected, found, met, text, requirement)


def _within_s(case: Case) -> Judged:
    """An event, or a signal within its bounds, in time."""
    given = case.expectation
    limit_s = given.within_s or 0.0
    if given.then is not None:
        what, found_s = given.then, _latency_s(case, given.then)
    else:
        what = f"{given.signal} {_bounds_told(given)}"
        part = _part(case)
        found_s = None if part is None else signal_checks.reached_s(part, given.min, given.max)
    wanted = f"{what} within {limit_s * 1e3:g} ms {origin_told(given)}"
    if found_s is None:
        return None, False, f"{wanted}: never"
    return found_s, found_s <= limit_s, f"{wanted}: {found_s * 1e3:.3f} ms"


def _latency_s(case: Case, name: str) -> float | None:
    times = case.instants_ns(name)
    return (times[0] - case.window.origin_ns) * 1e-9 if times else None


def _bounds_told(given: Expectation) -> str:
    bounds = [
        f"{word} {value:g}"
        for word, value in (("at least", given.min), ("at most", given.max))
        if value is not None
    ]
    return " and ".join(bounds)


def _part(case: Case) -> Part | None:
    """The judged stretch of the expectation's signal; None without a value in it."""
    given, window = case.expectation, case.window
    whole = case.data.traces[str(given.signal)]
    trace = whole.between(window.start_ns, window.end_ns)
    if not len(trace.t_ns):
        return None
    before = float(whole.at(np.array([window.start_ns]))[0])
    reference = None
    if given.recorded is not None:
        reference = read_recorded(Path(given.recorded), str(given.signal)).at(trace.t_ns)
    elif isinstance(given.reference, str):
        reference = case.data.traces[given.reference].at(trace.t_ns)
    elif given.reference is not None:
        reference = np.full(len(trace.t_ns), given.reference)
    return Part(trace, before, reference, window.origin_ns)


def _of_signal(key: str, wording: str, judged: Callable[[Part, Expectation], Judged]) -> _Judge:
    """Return the judge of one demand on a signal."""

    def check(case: Case) -> Judged:
        given = case.expectation
        what = f"{given.statistic} of {given.signal}" if given.statistic else str(given.signal)
        limit = f"{getattr(given, key):g}"
        wanted = f"{what} {wording.format(limit)}{told(given)}"
        part = _part(case)
        if part is None:
            return None, False, f"{wanted}: no value of it there"
        found, met, text = judged(part, given)
        return found, met, f"{wanted}: {text}"

    return check


def _no_later(found_s: float | None, limit_s: float | None) -> Judged:
    if found_s is None:
        return None, False, "not reached"
    return found_s, found_s <= (limit_s or 0.0), f"{found_s * 1e3:.3f} ms"


def _overshoot(part: Part, given: Expectation) -> Judged:
    found = signal_checks.overshoot(part)
    if found is None:
        return None, False, "it makes no step"
    return found, found <= (given.overshoot or 0.0), f"{found:.4g}"


_Judge = Callable[[Case], Judged]
_JUDGES: Final[dict[str, _Judge]] = {
    "within_mm": engine_checks.within_mm,
    "peak_mm": engine_checks.peak_mm,
    "mode": engine_checks.mode,
    "at_rest": engine_checks.at_rest,
    "contacts": engine_checks.contacts,
    "misfires_min": engine_checks.misfires_min,
    "min": _of_signal(
        "min", "at least {}", lambda p, e: signal_checks.low(p, e.min or 0.0, e.statistic)
    ),
    "max": _of_signal(
        "max", "at most {}", lambda p, e: signal_checks.high(p, e.max or 0.0, e.statistic)
    ),
    "tolerance": _of_signal(
        "tolerance", "no further than {} from its reference",
        lambda p, e: signal_checks.deviation(p, e.tolerance or 0.0, relative=e.relative),
    ),
    "rise_s": _of_signal(
        "rise_s", "rises within {} s", lambda p, e: _no_later(signal_checks.rise_s(p), e.rise_s)
    ),
    "settling_s": _of_signal(
        "settling_s", "settles within {} s",
        lambda p, e: _no_later(
            signal_checks.settling_s(p, e.tolerance or 0.0, relative=e.relative), e.settling_s
        ),
    ),
    "overshoot": _of_signal("overshoot", "overshoots by at most {}", _overshoot),
    "within_s": _within_s,
    "never": engine_checks.never,
    "order": engine_checks.order,
}  # fmt: skip
assert set(OF_A_SIGNAL) <= set(_JUDGES)
