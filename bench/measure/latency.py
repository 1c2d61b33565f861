"""`hil bench latency`: our loop, cyclictest and a bare ping-pong in turns, compared in one run."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from bench.measure import cyclictest
from bench.progress import counted, progress
from bench.run import directory, scenarios
from bench.run.resolve import resolve
from hil.config.resolved import Resolved
from hil.errors import RunError

QUANTILES: Final = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9}
TARGETS: Final = {
    "lateness p99, loop / cyclictest": 2.0,
    "round trip p50, link / bare": 1.3,
    "round trip p99, link / bare": 1.5,
}
_GRACE_S: Final = 30.0
Values = NDArray[np.float64]


class Plan(NamedTuple):
    """What is measured: over which link, at which rate, in how many rounds of so many seconds."""

    link: str
    rate_hz: int
    rounds: int
    seconds: float


class Found(NamedTuple):
    """Samples of all rounds [us] by series, and what was counted."""

    series: dict[str, list[Values]]
    counts: dict[str, int]
    granted: dict[str, str]


def run(plan: Plan, out: Path | None, *, force: bool = False) -> int:
    """Measure, print, and write latency.json and latency.png.

    Raises: RunError when a process of it fails, ConfigError
    """
    names = ("latency.json", "latency.png")
    files = [] if out is None else directory.claim("--out", out, names, force=force)
    console = Console(highlight=False)
    if not cyclictest.installed():
        console.print(f"cyclictest is not installed, so no comparison: {cyclictest.HINT}")
    found = Found({}, {}, {})
    with progress("latency", plan.rounds, "rounds") as advance:
        for _ in counted(range(plan.rounds), advance):
            measure_round(plan, found)
    told = summarise(plan, found)
    _print(console, told)
    if files:
        from bench.measure.latency_plot import write_picture

        figures, picture = files
        figures.write(json.dumps(told, indent=1))
        with picture.writing() as beside:
            write_picture(told, beside)
        console.print(f"{figures.path}, {picture.path}")
    return 0


def measure_round(plan: Plan, found: Found) -> None:
    """Take one turn each; what they share is the state that the machine is in by now."""
    with tempfile.TemporaryDirectory(prefix="hil-") as name:
        scenario = scenario_of(plan, Path(name))
        if cyclictest.installed():
            priority = scenario.realtime.priority
            late_us = cyclictest.measure(plan.rate_hz, plan.seconds, priority)
            found.series.setdefault("late cyclictest", []).append(late_us)
        for kind in ("bare", "link", "loop"):
            _take(kind, pair(kind, scenario, Path(name)), found)


def scenario_of(plan: Plan, sockets: Path) -> Resolved:
    """Return the steady scenario over the link to be measured, on sockets of its own."""
    changes = [
        ("link.kind", plan.link), ("loop.clock", "realtime"), ("loop.rate_hz", plan.rate_hz),
        ("run.duration_s", plan.seconds),
    ]  # fmt: skip
    return resolve(scenarios.read("steady", changes), sockets)


def pair(kind: str, scenario: Resolved, folder: Path) -> dict[str, Any]:
    """Run a source and who answers it; return what the source measured.

    Raises: RunError when it fails
    """
    config, out = folder / "scenario.json", folder / f"{kind}.json"
    config.write_text(scenario.model_dump_json(), encoding="utf-8")
    role = ["-m", "controller.main", "--log", str(folder / "controller.mcap")]
    answering = role if kind == "loop" else ["-m", "bench.measure.pingpong", f"{kind}-echo"]
    asking = ["-m", "bench.measure.pingpong", f"{kind}-source", "--out", str(out)]
    processes = [_start([*words, "--config", str(config)]) for words in (asking, answering)]
    try:
        _, errors = processes[0].communicate(timeout=scenario.run.duration_s + _GRACE_S)
        if processes[0].returncode:
            raise RunError(f"{kind}: {errors.strip() or 'its source failed'}")
        processes[1].communicate(timeout=_GRACE_S)
    except subprocess.TimeoutExpired:
        raise RunError(f"{kind}: did not end in time") from None
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
            process.communicate()  # a second time only closes
    told: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return told


def _start(words: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", *words],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def _take(kind: str, told: dict[str, Any], found: Found) -> None:
    """Add what a source measured."""
    late, trip = (np.asarray(told[key], dtype=float) / 1e3 for key in ("late_ns", "trip_ns"))
    found.series.setdefault(f"trip {kind}", []).append(trip)
    if kind == "loop":
        found.series.setdefault("late loop", []).append(late)
        for key in ("missed", "unanswered"):
            found.counts[key] = found.counts.get(key, 0) + told[key]
        found.granted.update(told["granted"])


def quantiles(values: Values) -> dict[str, float]:
    """Return p50, p99, p99.9 and the largest [us]."""
    if not len(values):
        return {}
    found = {name: float(np.percentile(values, q)) for name, q in QUANTILES.items()}
    return {**found, "max": float(values.max())}


def summarise(plan: Plan, found: Found) -> dict[str, Any]:
    """Return everything as one tree: quantiles, ratios by round, histograms, the machine."""
    series = {name: np.concatenate(rounds) for name, rounds in found.series.items()}
    period_us = 1e6 / plan.rate_hz
    return {
        "plan": plan._asdict(),
        "machine": machine(),
        "granted": found.granted,
        "figures_us": {name: quantiles(values) for name, values in series.items()},
        "samples": {name: len(values) for name, values in series.items()},
        "beyond_a_period": {name: float((v > period_us).mean()) for name, v in series.items()},
        "counts": found.counts,
        "ratios": ratios(found),
        "histograms": {name: histogram(values) for name, values in series.items()},
    }


def ratios(found: Found) -> dict[str, Any]:
    """Return each ratio: its target, pooled over the rounds, and in each of them."""
    pairs = {name: words.split(" / ") for name, words in
             ((name, name.rsplit(", ", 1)[1]) for name in (*TARGETS, *_MORE))}  # fmt: skip
    told = {}
    for name, (over, under) in pairs.items():
        kind, quantile = _KINDS[name.rsplit(" p", 1)[0]], float(name.rsplit(" p", 1)[1][:2])
        ours, theirs = (found.series.get(f"{kind} {which}") for which in (over, under))
        if ours and theirs:
            each = [
                float(np.percentile(a, quantile) / np.percentile(b, quantile))
                for a, b in zip(ours, theirs, strict=True)
            ]
            joined = [np.percentile(np.concatenate(s), quantile) for s in (ours, theirs)]
            pooled = float(joined[0] / joined[1])
            told[name] = {"target": TARGETS.get(name), "pooled": pooled, "rounds": each}
    return told


_KINDS: Final = {"lateness": "late", "round trip": "trip"}
_MORE: Final = ("round trip p50, loop / bare", "round trip p99, loop / bare")


def histogram(values: Values) -> dict[str, list[float]]:
    """Return edges [us] and counts in bins of equal ratio; what is below joins the first."""
    edges = np.concatenate([[0.0], np.geomspace(0.5, 1e5, 107)])
    counts = np.histogram(np.clip(values, 0.0, 1e5), bins=edges)[0]
    return {"edges_us": edges.tolist(), "counts": counts.tolist()}


def machine() -> dict[str, Any]:
    """Say what was measured on, and how busy it was."""
    return {
        "kernel": platform.release(),
        "processors": len(os.sched_getaffinity(0)),
        "load": list(os.getloadavg()),
        "python": platform.python_version(),
        "cyclictest": cyclictest.installed(),
        "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
    }


def _print(console: Console, told: dict[str, Any]) -> None:
    """Print figures and ratios as two tables."""
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", title_justify="left")
    for title in ("[µs]", "p50", "p99", "p99.9", "max", "samples", "over a period"):
        table.add_column(title, justify="left" if title == "[µs]" else "right")
    for name, figures in told["figures_us"].items():
        words = [f"{value:.0f}" for value in figures.values()]
        share = f"{told['beyond_a_period'][name] * 100:.3f} %"
        table.add_row(name, *words, str(told["samples"][name]), share)
    console.print(table)
    for name, ratio in told["ratios"].items():
        each = " ".join(f"{value:.2f}" for value in ratio["rounds"])
        target = f" (at most {ratio['target']:g})" if ratio["target"] else ""
        console.print(f"{name}: {ratio['pooled']:.2f}{target}; by round {each}")
    counts = told["counts"]
    load = told["machine"]["load"][0]
    console.print(f"ticks missed {counts['missed']}, not answered in 0.8 of a period "
                  f"{counts['unanswered']}; load of the machine {load:.1f}")  # fmt: skip
