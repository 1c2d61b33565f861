"""`hil bench recorder`: how many ticks a second a recorder process takes, and what of a core."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.console import Console

import controller.build
import plant.build
from bench.measure.latency import machine
from bench.run import directory, scenarios
from bench.run.resolve import resolve
from drivers.links import open_memory
from drivers.memory_link import MemoryLink
from drivers.recorder.client import Recorder
from drivers.system.effort import Effort
from hil import ports

_KEPT: Final = 2000
_SETTLE_S: Final = 0.3


class Kept(ports.Recorder):
    """A recorder that keeps the records of each tick."""

    def __init__(self) -> None:
        self.turns: list[bytes] = []

    def put(self, data: bytes, /) -> None:
        """Keep them."""
        self.turns.append(data)


class Cost(NamedTuple):
    """What one log takes: ticks a second as fast as they are taken, processor time, bytes."""

    log: str
    ticks_a_s: float
    ticks_a_core_s: float
    us_a_tick: float
    bytes_a_tick: float
    written_a_tick: float


def run(ticks: int, out: Path | None, *, force: bool = False) -> int:
    """Record so many ticks of the steady scenario, plant and controller in turn."""
    files = [] if out is None else directory.claim("--out", out, ("recorder.json",), force=force)
    kept = _turns()
    costs = [measure(name, turns, ticks) for name, turns in kept.items()]
    _print(Console(highlight=False), costs)
    for file in files:
        told = {"machine": machine(), "recorders": [cost._asdict() for cost in costs]}
        file.write(json.dumps(told, indent=1))
    return 0


def _turns() -> dict[str, list[bytes]]:
    """The records of some ticks, as both loops put them."""
    changes: list[tuple[str, Any]] = [
        ("link.kind", "memory"), ("loop.clock", "lockstep"), ("run.duration_s", _KEPT / 1000.0)
    ]  # fmt: skip
    scenario, ends = resolve(scenarios.read("steady", changes)), open_memory()
    kept = {"plant": Kept(), "controller": Kept()}
    loop = plant.build.make_loop(scenario, ends[0], kept["plant"])
    answering = controller.build.make_loop(scenario, ends[1], kept["controller"])
    assert isinstance(ends[0].link, MemoryLink)
    ends[0].link.on_send = lambda: answering.turn(ends[1].link.receive())
    tick = 0
    while tick < _KEPT:
        tick = loop.turn(tick)
    return {name: recorder.turns for name, recorder in kept.items()}


def measure(name: str, turns: list[bytes], ticks: int) -> Cost:
    """Put the turns over and over, as fast as a recorder process takes them."""
    with tempfile.TemporaryDirectory(prefix="hil-recorder-") as place:
        path = Path(place) / "log.mcap"
        recorder = Recorder.open(path, {}, blocking=True)
        try:
            while not path.stat().st_size:
                time.sleep(0.001)
            time.sleep(_SETTLE_S)  # its start is no part of it
            effort = Effort(recorder)
            for k in range(ticks):
                recorder.put(turns[k % len(turns)])
            while recorder.waiting:
                time.sleep(0.001)
            told = effort.told()
        finally:
            recorder.close()
        written = path.stat().st_size / ticks
    core_s, wall_s = told["recorder_cpu_s"], told["loop_s"]
    size = sum(map(len, turns)) / len(turns)
    return Cost(name, ticks / wall_s, ticks / core_s, core_s / ticks * 1e6, size, written)


def _print(console: Console, costs: list[Cost]) -> None:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    titles = ("recorder of", "ticks/s", "ticks/s of a core", "µs a tick", "bytes", "written")
    for title in titles:
        table.add_column(title, justify="left" if title == titles[0] else "right")
    for cost in costs:
        table.add_row(
            cost.log, f"{cost.ticks_a_s:,.0f}", f"{cost.ticks_a_core_s:,.0f}",
            f"{cost.us_a_tick:.2f}", f"{cost.bytes_a_tick:.0f}", f"{cost.written_a_tick:.0f}",
        )  # fmt: skip
    console.print(table)
