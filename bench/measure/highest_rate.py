"""`hil bench rate`: the highest rate at which this machine meets its deadlines."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from rich.console import Console

from bench.judge.figures import read_run
from bench.judge.punctuality import answered_share
from bench.measure import cyclictest
from bench.measure.latency import machine
from bench.run import directory, scenarios
from bench.run.execution import execute, resolved
from hil.config.resolved import Resolved
from hil.errors import InterruptedRunError, LogError, RunError

MISSED_AT_MOST: Final = 1e-4
LADDER_HZ: Final = (
    50, 100, 200, 500, 1000, 1500, 2000, 2500, 3000, 4000, 5000, 6000, 8000, 10_000, 12_000,
    15_000, 20_000,
)  # fmt: skip
_GIVE_UP_AFTER: Final = 2
"""So many rates in a row that are not held; noise may spoil one."""

_CYCLICTEST_S: Final = 2.0


class Trial(NamedTuple):
    """One rate; shares of ticks, None when the run came to nothing."""

    rate_hz: int
    missed: float | None
    answered: float | None
    late_p99_us: float | None
    cyclictest_beyond: float | None

    @property
    def held(self) -> bool:
        """Whether at most 1 deadline in 10 000 was missed."""
        return self.missed is not None and self.missed <= MISSED_AT_MOST


class _Quiet:
    """Shows nothing of a run."""

    def __enter__(self) -> _Quiet:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave nothing behind."""

    def update(self, status: object) -> None:
        """Take no notice."""


def run(
    link: str, limits_hz: tuple[int, int], seconds: float, out: Path | None, *, force: bool = False
) -> int:
    """Climb from rate to rate; print each and the highest that was held.

    Raises: ConfigError
    """
    files = [] if out is None else directory.claim("--out", out, ("rate.json",), force=force)
    console = Console(highlight=False)
    if not cyclictest.installed():
        console.print(f"cyclictest is not installed, so no comparison: {cyclictest.HINT}")
    trials: list[Trial] = []
    for rate_hz in (rate for rate in LADDER_HZ if limits_hz[0] <= rate <= limits_hz[1]):
        trials.append(try_rate(link, rate_hz, seconds))
        console.print(line(trials[-1]), soft_wrap=True)
        if len(trials) >= _GIVE_UP_AFTER and not any(t.held for t in trials[-_GIVE_UP_AFTER:]):
            break
    best = highest(trials)
    console.print(f"highest rate held: {f'{best} Hz' if best else 'none of these'}")
    for file in files:
        told = {"link": link, "seconds": seconds, "highest_hz": best, "machine": machine(),
                "trials": [{**t._asdict(), "held": t.held} for t in trials]}  # fmt: skip
        file.write(json.dumps(told, indent=1))
    return 0


def highest(trials: list[Trial]) -> int | None:
    """Return the highest rate held, None when none was."""
    return max((trial.rate_hz for trial in trials if trial.held), default=None)


def try_rate(link: str, rate_hz: int, seconds: float) -> Trial:
    """Run the steady scenario at a rate, recorders included, beside cyclictest in the same minute.

    Raises: ConfigError
    """
    changes: list[tuple[str, Any]] = [
        ("link.kind", link), ("loop.clock", "realtime"), ("loop.rate_hz", rate_hz),
        ("run.duration_s", seconds),
    ]  # fmt: skip
    with (
        tempfile.TemporaryDirectory(prefix="hil-rate-") as name,
        resolved(scenarios.read("steady", changes)) as scenario,
    ):
        beyond = _beyond(rate_hz, scenario) if cyclictest.installed() else None
        files = directory.prepare(scenario.name, Path(name) / "run", force=False)
        ended = execute(scenario, files, _Quiet())
        if isinstance(ended.error, InterruptedRunError):
            raise KeyboardInterrupt
        try:
            data = read_run(scenario, files)
        except (LogError, RunError):
            return Trial(rate_hz, None, None, None, beyond)
        timing = data.timing["plant"]
        whole = timing.ticks >= round(seconds * rate_hz) and ended.error is None
        late_ns = timing.late.quantile_ns(0.99)
        missed = timing.missed / timing.ticks if whole else None
        late_us = None if late_ns is None else late_ns * 1e-3
        return Trial(rate_hz, missed, answered_share(timing), late_us, beyond)


def _beyond(rate_hz: int, scenario: Resolved) -> float:
    """Return the share of cyclictest's cycles that were later than a period."""
    late_us = cyclictest.measure(rate_hz, _CYCLICTEST_S, scenario.realtime.priority)
    return float(np.mean(late_us > 1e6 / rate_hz))


def line(trial: Trial) -> str:
    """Return one trial as a line."""
    if trial.missed is None:
        text = "the run did not come to its end, or its log is not whole"
    else:
        text = f"missed {trial.missed * 100:.4f} %"
    if trial.answered is not None:
        text += f", answered in the next tick {trial.answered * 100:.3f} %"
    if trial.late_p99_us is not None:
        text += f", late p99 {trial.late_p99_us:.0f} µs"
    if trial.cyclictest_beyond is not None:
        text += f"; cyclictest beyond a period {trial.cyclictest_beyond * 100:.4f} %"
    return f"{trial.rate_hz:6d} Hz  {'held' if trial.held else 'not held'}: {text}"
