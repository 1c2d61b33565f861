"""`hil bench lockstep`: how many times real time a run in one process goes, and its replay."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.console import Console
from rich.table import Table

import controller.build
import plant.build
from bench.logs.replay.replay import replay_file
from bench.measure.latency import machine
from bench.run import directory, offline, scenarios
from bench.run.resolve import resolve
from drivers.links import open_memory
from drivers.system.log import open_recorder
from drivers.system.realtime import prepare
from hil import compiled
from hil.config.resolved import Resolved
from hil.log.part import ALWAYS

SIDES: Final = ("plant", "controller")


class Ratio(NamedTuple):
    """What ran, and how many times real time."""

    what: str
    times_real_time: float


def run(seconds: float, out: Path | None, model: str, law: str) -> int:
    """Run so many seconds of the steady scenario in lockstep, replay both logs, print."""
    if out is not None:
        directory.make_directory("--out", out)
    found = measure(seconds, model, law)
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("steady, one process, start-up excluded")
    table.add_column("times real time", justify="right")
    for what, times in found:
        table.add_row(what, f"{times:.0f}")
    console = Console(highlight=False)
    console.print(table)
    console.print(f"{'compiled' if compiled.in_force() else 'interpreted'} loops, {model}, {law}")
    if out is not None:
        told = {"machine": machine(), "compiled": compiled.in_force(), **dict(found)}
        (out / "lockstep.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
    return 0


def measure(seconds: float, model: str, law: str) -> list[Ratio]:
    """Return the ratios of the run with both logs, and of the replay of each."""
    changes: list[tuple[str, Any]] = [
        ("link.kind", "memory"), ("loop.clock", "lockstep"), ("run.duration_s", seconds),
        ("plant.model", model), ("controller.name", law),
    ]  # fmt: skip
    scenario = resolve(scenarios.read("steady", changes))
    with tempfile.TemporaryDirectory(prefix="hil-lockstep-") as name:
        logs = {side: Path(name) / f"{side}.mcap" for side in SIDES}
        prepare(scenario.realtime)
        found = [Ratio("run, both logs on", seconds / _run_s(scenario, logs))]
        for side, path in logs.items():
            outcome = replay_file(path, None, ALWAYS)
            assert outcome.identical, f"the replay of the {side} differs"
            found.append(Ratio(f"replay of the {side}", outcome.simulated_s / outcome.cpu_s))
    return found


def _run_s(scenario: Resolved, logs: dict[str, Path]) -> float:
    """Run the scenario; return how long the loops took, logs finished [s]."""
    recorders = [open_recorder(path, scenario, side) for side, path in logs.items()]
    try:
        ends = open_memory()
        loop = plant.build.make_loop(scenario, ends[0], recorders[0])
        answering = controller.build.make_loop(scenario, ends[1], recorders[1])
        offline.join(ends[0].link, ends[1].link, answering)
        start_s = time.perf_counter()
        offline.run_ticks(loop, 0, scenario.ticks)
        return time.perf_counter() - start_s
    finally:
        for recorder in recorders:
            recorder.close()
