"""A law of one's own put through its paces: what the loops rely on, tried and told by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.run.offline import Course, simulate
from bench.run.resolve import resolve
from bench.run.scenarios import read
from controller.motion.fuelling import Fuelling
from controller.motion.law import NO_DEMAND
from controller.motion.own import own_source
from hil import snapshot
from hil.brought import SUFFIX
from hil.config.resolved import Resolved
from hil.errors import ConfigError, HilError

_CASES: Final = (("steady", 1.0), ("load-decrease", 1.6), ("misfire", 1.6), ("start", 1.5))
"""Scenarios that show a law all that may come, and for how long [s]."""

_NEAR_M: Final = 1.0e-3
"""Of its set point, at the end of a steady run."""

_MOST_US: Final = 200.0
"""A fifth of a tick of 1 kHz."""


class Finding(NamedTuple):
    """One demand on a law: met or not, and what was seen."""

    demand: str
    met: bool
    seen: str


class _Watched:
    """What one law's steps were seen to do."""

    def __init__(self) -> None:
        self.calls = 0
        self.impure = self.changed = self.unwritable = ""
        self.spent_s = 0.0

    def step(self, original: Callable[..., Any], law: Any, state: Any, view: Any) -> Any:  # noqa: ANN401
        """Ask the law twice, and look at the state before and after."""
        before = self._text(state)
        begun_s = time.perf_counter()
        given = original(law, state, view)
        self.spent_s += time.perf_counter() - begun_s
        self.calls += 1
        if repr(original(law, state, view)) != repr(given):
            self.impure = f"call {self.calls}"
        if self._text(state) != before:
            self.changed = f"call {self.calls}"
        return given

    def _text(self, value: Any) -> str:  # noqa: ANN401
        try:
            return snapshot.dumps(Fuelling("own", value, NO_DEMAND, (0.0, 0.0)))
        except TypeError as error:
            self.unwritable = str(error)
            return repr(value)


def findings(file: Path) -> list[Finding]:
    """Run a law through scenarios, twice, and say what it does of what is demanded.

    Raises: ConfigError when it cannot be loaded
    """
    scenarios = [_scenario(file, name, duration_s) for name, duration_s in _CASES]
    source = own_source(scenarios[0].controller)
    assert source is not None, "a file was given"
    with _watching(source[0]) as seen:
        first, fault = _courses(scenarios)
    second, _ = _courses(scenarios) if not fault else ([], "")
    us = 1e6 * seen.spent_s / max(seen.calls, 1)
    running = [course.mode for course in first]
    return [
        Finding(
            "range: a finite fuel in every stroke", not fault, fault or f"{seen.calls} strokes"
        ),
        Finding("purity: the same answer to the same question", not seen.impure, seen.impure),
        Finding("purity: its state is not changed in place", not seen.changed, seen.changed),
        Finding(
            "snapshot: its state can be written and read", not seen.unwritable, seen.unwritable
        ),
        Finding("determinism: two runs are the same", first == second and not fault, ""),
        Finding(f"time: {_MOST_US:g} us a step in the mean", us <= _MOST_US, f"{us:.1f} us"),
        Finding("it keeps the engine running", set(running) == {"generating"}, ", ".join(running)),
        _holding(scenarios[0], first),
    ]


def _holding(steady: Resolved, courses: list[Course]) -> Finding:
    """Whether the dead centre is where it was to be, when nothing has disturbed the engine."""
    if not courses:
        return Finding("it holds the dead centre", False, "")
    off_m = abs(courses[0].dead_centres[-1].x_m) - steady.controller.tdc_ref_m
    return Finding("it holds the dead centre", abs(off_m) < _NEAR_M, f"{1e3 * off_m:+.3f} mm")


def _scenario(file: Path, name: str, duration_s: float) -> Resolved:
    changes = [
        ("controller.name", str(file)), ("run.duration_s", duration_s),
        ("loop.clock", "lockstep"),
    ]  # fmt: skip
    return resolve(read(name, changes))


def _courses(scenarios: list[Resolved]) -> tuple[list[Course], str]:
    """Run them all; the text is what ended one before its time."""
    courses = []
    for scenario in scenarios:
        try:
            courses.append(simulate(scenario))
        except ConfigError:
            raise
        except HilError as error:
            return courses, f"{scenario.name}: {error}"
    return courses, ""


@contextmanager
def _watching(kind: Any) -> Iterator[_Watched]:  # noqa: ANN401
    """Look at every step of a class meanwhile."""
    seen, original = _Watched(), kind.step
    kind.step = lambda law, state, view: seen.step(original, law, state, view)
    try:
        yield seen
    finally:
        kind.step = original


def run(file: Path) -> int:
    """Say what a law does of what is demanded; 0 when all of it.

    Raises: ConfigError when it cannot be loaded
    """
    if file.suffix != SUFFIX:
        raise ConfigError(f"{file}: accepted is a law of one's own, a file ending in {SUFFIX}")
    found = findings(file)
    for finding in found:
        sign, tail = "✓" if finding.met else "✗", f": {finding.seen}" if finding.seen else ""
        print(f"{sign} {finding.demand}{tail}")
    return 0 if all(finding.met for finding in found) else 1
