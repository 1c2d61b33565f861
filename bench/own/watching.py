"""Looking at what a user's class does, call by call: what the loops rely on, and tell by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.run.offline import Course, simulate
from bench.run.resolve import resolve
from bench.run.scenarios import read
from hil import snapshot
from hil.config.resolved import Resolved
from hil.errors import ConfigError, HilError

CASES: Final = (("steady", 1.0), ("load-decrease", 1.6), ("misfire", 1.6), ("start", 1.5))
"""Scenarios that show all that may come, and for how long [s]."""

_NEAR_M: Final = 1.0e-3
"""Of its set point, at the end of a steady run."""

_MOST_US: Final = 200.0
"""A fifth of a tick of 1 kHz."""


class Finding(NamedTuple):
    """One demand: met or not, and what was seen."""

    demand: str
    met: bool
    seen: str


class Watched:
    """What the calls of one class were seen to do.

    Parameters: valued : from a state to what a snapshot would hold of it
    """

    def __init__(self, valued: Callable[[Any], Any]) -> None:
        self._valued = valued
        self.calls = 0
        self.impure = self.changed = self.unwritable = ""
        self.spent_s = 0.0

    def call(self, original: Callable[..., Any], one: Any, state: Any, *rest: Any) -> Any:  # noqa: ANN401
        """Ask twice, and look at the state before and after."""
        before = self._text(state)
        begun_s = time.thread_time()
        given = original(one, state, *rest)
        self.spent_s += time.thread_time() - begun_s
        self.calls += 1
        name = f"{original.__name__}, call {self.calls}"
        if repr(original(one, state, *rest)) != repr(given):
            self.impure = name
        if self._text(state) != before:
            self.changed = name
        return given

    def _text(self, state: Any) -> str:  # noqa: ANN401
        try:
            return snapshot.dumps(self._valued(state))
        except TypeError as error:
            self.unwritable = str(error)
            return repr(state)


@contextmanager
def watching(
    kind: Any, methods: Sequence[str], valued: Callable[[Any], Any]  # noqa: ANN401
) -> Iterator[Watched]:  # fmt: skip
    """Look at every call of some methods of a class meanwhile."""
    seen = Watched(valued)
    originals = {name: getattr(kind, name) for name in methods if hasattr(kind, name)}
    for name, original in originals.items():
        setattr(kind, name, _watched(seen, original))
    try:
        yield seen
    finally:
        for name, original in originals.items():
            setattr(kind, name, original)


def _watched(seen: Watched, original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda one, state, *rest: seen.call(original, one, state, *rest)


def scenarios(key: str, file: Path) -> list[Resolved]:
    """Return the cases with a file in the place of the law or the engine.

    Raises: ConfigError when it cannot be loaded
    """
    return [
        resolve(read(name, [
            (key, str(file)), ("run.duration_s", duration_s), ("loop.clock", "lockstep")
        ]))
        for name, duration_s in CASES
    ]  # fmt: skip


def courses(cases: list[Resolved]) -> tuple[list[Course], str]:
    """Run them all; the text is what ended one before its time."""
    found = []
    for scenario in cases:
        try:
            found.append(simulate(scenario))
        except ConfigError:
            raise
        except HilError as error:
            return found, f"{scenario.name}: {error}"
    return found, ""


def findings_of(
    kind: Any, methods: Sequence[str], valued: Callable[[Any], Any], cases: list[Resolved]  # noqa: ANN401
) -> list[Finding]:  # fmt: skip
    """Run the cases twice, the first time looked at, and say what is done of what is demanded."""
    with watching(kind, methods, valued) as seen:
        first, fault = courses(cases)
    second, _ = courses(cases) if not fault else ([], "")
    us = 1e6 * seen.spent_s / max(seen.calls, 1)
    modes = [course.mode for course in first]
    return [
        Finding("range: finite, at every call", not fault, fault or f"{seen.calls} calls"),
        Finding("purity: the same answer to the same question", not seen.impure, seen.impure),
        Finding("purity: its state is not changed in place", not seen.changed, seen.changed),
        Finding(
            "snapshot: its state can be written and read", not seen.unwritable, seen.unwritable
        ),
        Finding("determinism: two runs are the same", first == second and not fault, ""),
        Finding(f"time: {_MOST_US:g} us a call in the mean", us <= _MOST_US, f"{us:.1f} us"),
        Finding("the engine keeps running", set(modes) == {"generating"}, ", ".join(modes)),
        _holding(cases[0], first),
    ]


def _holding(steady: Resolved, found: list[Course]) -> Finding:
    """Whether the dead centre is where it was to be, when nothing has disturbed the engine."""
    if not found or not found[0].dead_centres:
        return Finding("the dead centre is held", False, "")
    off_m = abs(found[0].dead_centres[-1].x_m) - steady.controller.tdc_ref_m
    return Finding("the dead centre is held", abs(off_m) < _NEAR_M, f"{1e3 * off_m:+.3f} mm")


def tell(found: list[Finding]) -> int:
    """Print what was found; 0 when all of it is met, 1 when not."""
    for finding in found:
        sign, tail = "✓" if finding.met else "✗", f": {finding.seen}" if finding.seen else ""
        print(f"{sign} {finding.demand}{tail}")
    return 0 if all(finding.met for finding in found) else 1
