"""`hil bench step`: what a tick of both loops costs, and its parts, over the memory link."""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

import controller.build
import plant.build
from bench.measure.latency import machine
from bench.measure.step_parts import WARM_UP, Changes, costs_us
from bench.run import directory, offline, scenarios
from bench.run.resolve import resolve
from controller.motion.laws import LAWS
from drivers.links import open_memory
from drivers.recorder.client import NullRecorder
from drivers.system.log import open_recorder
from drivers.system.realtime import prepare
from hil import compiled
from hil.config.resolved import Resolved
from hil.errors import ConfigError

BUDGET_US: Final = {False: 50.0, True: 5.0}
"""Of a whole tick, interpreted and compiled."""

FAST: Final = ("closed-form", "harmonic", "rectangular", "nonlinear")
_TURNS: Final = 3
_RING: Final = "recorder rings"
_REST: Final = "turns, link, and what is not in the caches"


class Whole(NamedTuple):
    """A whole tick of both loops [us]: mean, and quantiles of single ticks."""

    mean_us: float
    p50_us: float
    p99_us: float


def run(
    ticks: int, out: Path | None, model: str, law: str, *, every: bool, force: bool = False
) -> int:
    """Run so many ticks of the steady scenario and print what they cost."""
    files = [] if out is None else directory.claim("--out", out, ("step.json",), force=force)
    console = Console(highlight=False)
    told: dict[str, Any] = {"machine": machine(), "compiled": compiled.in_force()}
    if every:
        told["whole_us"] = table = measure_all(ticks)
        console.print(_grid(table))
    else:
        whole, parts = measure(ticks, [("plant.model", model), ("controller.name", law)])
        told |= {"whole_us": whole.mean_us, **whole._asdict(), "parts": parts}
        console.print(_listed(whole, parts))
    kind = "compiled" if compiled.in_force() else "interpreted (`hil compile` makes it faster)"
    budget = f"{BUDGET_US[compiled.in_force()]:g} µs"
    console.print(f"{kind} loops; budget of a whole tick in lockstep over memory: {budget}")
    for file in files:
        file.write(json.dumps(told, indent=1))
    return 0


def _changes(ticks: int, changes: Changes) -> Changes:
    """The steady scenario in lockstep over memory, for the warm-up and so many ticks."""
    return [
        ("link.kind", "memory"),
        ("loop.clock", "lockstep"),
        ("run.duration_s", (WARM_UP + ticks) / 1000.0),
        *changes,
    ]


def measure(ticks: int, changes: Changes) -> tuple[Whole, dict[str, float]]:
    """Return what a tick costs with logs, and the parts of it, the dearest first [us]."""
    changes = _changes(ticks, changes)
    scenario = resolve(scenarios.read("steady", changes))
    with tempfile.TemporaryDirectory(prefix="hil-step-") as name:
        prepare(scenario.realtime)
        parts = costs_us(changes, ticks, Path(name))
        logged = min((_whole(scenario, Path(name)) for _ in range(_TURNS)), key=lambda w: w[0])
        bare = min(_whole(scenario, None)[0] for _ in range(_TURNS))
    parts[_REST] = max(bare - sum(parts.values()), 0.0)
    parts[_RING] = max(logged.mean_us - bare, 0.0)
    return logged, dict(sorted(parts.items(), key=lambda item: -item[1]))


def measure_all(ticks: int) -> dict[str, dict[str, float | None]]:
    """Return the mean of every fast model and law [us]; None where the law refuses the model."""
    table: dict[str, dict[str, float | None]] = {}
    with tempfile.TemporaryDirectory(prefix="hil-step-") as name:
        prepare(resolve(scenarios.read("steady", _changes(ticks, []))).realtime)
        for model in FAST:
            for law in LAWS:
                changes = [("plant.model", model), ("controller.name", law)]
                cost = None
                with contextlib.suppress(ConfigError):
                    scenario = resolve(scenarios.read("steady", _changes(ticks, changes)))
                    cost = min(_whole(scenario, Path(name)).mean_us for _ in range(_TURNS))
                table.setdefault(model, {})[law] = cost
    return table


def _whole(scenario: Resolved, logs: Path | None) -> Whole:
    """Run the scenario once, with logs if there is a place for them."""
    ends = open_memory()
    recorders = [
        NullRecorder() if logs is None else open_recorder(logs / f"{side}.mcap", scenario, side)
        for side in ("plant", "controller")
    ]
    try:
        loop = plant.build.make_loop(scenario, ends[0], recorders[0])
        answering = controller.build.make_loop(scenario, ends[1], recorders[1])
        offline.join(ends[0].link, ends[1].link, answering)
        tick = offline.run_ticks(loop, 0, WARM_UP)
        middle = (tick + scenario.ticks) // 2
        start_ns = time.perf_counter_ns()
        tick = offline.run_ticks(loop, tick, middle)
        mean_us = (time.perf_counter_ns() - start_ns) / (middle - WARM_UP) * 1e-3
        single_us = _single(loop, tick, scenario.ticks)
    finally:
        for recorder in recorders:
            recorder.close()
    p50, p99 = np.percentile(single_us, [50, 99])
    return Whole(mean_us, float(p50), float(p99))


def _single(loop: Any, tick: int, end: int) -> list[float]:  # noqa: ANN401
    """Time each tick by itself; the watch takes a tenth of a microsecond."""
    now, single_us = time.perf_counter_ns, []
    before_ns = now()
    while tick < end:
        tick = loop.turn(tick)
        now_ns = now()
        single_us.append((now_ns - before_ns) * 1e-3)
        before_ns = now_ns
    return single_us


def _listed(whole: Whole, parts: dict[str, float]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("part of a tick [µs]", "mean", "p50", "p99"):
        table.add_column(title, justify="left" if "part" in title else "right")
    for part, mean_us in parts.items():
        table.add_row(part, f"{mean_us:.2f}", "", "")
    table.add_row("whole tick, with both logs", *(f"{value:.2f}" for value in whole))
    return table


def _grid(costs: dict[str, dict[str, float | None]]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("whole tick [µs]")
    for law in LAWS:
        table.add_column(law, justify="right")
    for model, row in costs.items():
        table.add_row(model, *("-" if us is None else f"{us:.2f}" for us in row.values()))
    return table
