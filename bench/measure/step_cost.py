"""`hil bench step`: what each part of a tick costs, in one process over the memory link."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from rich.console import Console

import controller.build
import plant.build
from bench.measure.latency import machine
from bench.run import scenarios
from bench.run.resolve import resolve
from drivers.links import open_memory
from drivers.memory_link import MemoryLink
from drivers.system.process import open_recorder
from drivers.system.realtime import prepare
from hil import compiled

BUDGET_US: Final = 50.0
_WARM_UP: Final = 200
_PLANT_PARTS: Final = {
    "_measure": "plant: sensors and encoding",
    "_understand": "plant: decoding the answer",
    "_record": "plant: packing records",
    "_tell": "plant: status",
}
_CONTROLLER_PARTS: Final = {
    "_take": "controller: decoding the sample",
    "_step": "controller: layers",
    "_command": "controller: looking for commands",
    "_record": "controller: packing records",
    "_tell": "controller: status",
}
_TURN, _ANSWER = "plant: physics and turn", "controller: turn"
_ENCODING, _RING = "controller: encoding", "recorder ring"


class Stopwatch:
    """Time by part; while an inner part runs, the outer one stands still."""

    def __init__(self) -> None:
        self.ticks: list[dict[str, int]] = []
        self._open: list[str] = []
        self._since_ns = 0

    def begin_tick(self) -> None:
        """Count from now on for another tick."""
        self.ticks.append({})

    def around(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its time counted for the part."""
        now = time.perf_counter_ns

        def timed(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401
            self._pass(now())
            self._open.append(part)
            try:
                return function(*arguments, **named)
            finally:
                self._pass(now())
                self._open.pop()

        return timed

    def _pass(self, now_ns: int) -> None:
        if self._open:
            tick, part = self.ticks[-1], self._open[-1]
            tick[part] = tick.get(part, 0) + now_ns - self._since_ns
        self._since_ns = time.perf_counter_ns()


class _TimedEncoder:
    """An encoder with its time counted."""

    def __init__(self, encoder: Any, watch: Stopwatch) -> None:  # noqa: ANN401
        self._encoder = encoder
        self.encode = watch.around(_ENCODING, encoder.encode)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._encoder, name)


class Cost(NamedTuple):
    """What a part takes of a tick [us]; the mean counts ticks without it as nothing."""

    part: str
    mean_us: float
    p50_us: float
    p99_us: float


def run(ticks: int, out: Path | None) -> int:
    """Run so many ticks of the steady scenario and print the parts."""
    watch = Stopwatch()
    whole_us = measure(ticks, watch)
    costs = costs_of(watch)
    _print(Console(highlight=False), costs, whole_us)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        told = {"machine": machine(), "whole_us": whole_us, "parts": [c._asdict() for c in costs]}
        (out / "step.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
    return 0


def measure(ticks: int, watch: Stopwatch) -> float:
    """Run so many ticks, then as many with every part timed; return the mean of the former [us]."""
    changes: list[tuple[str, Any]] = [
        ("link.kind", "memory"),
        ("loop.clock", "lockstep"),
        ("run.duration_s", (2 * ticks + _WARM_UP) / 1000.0),
    ]
    scenario = resolve(scenarios.read("steady", changes))
    ends = open_memory()
    with tempfile.TemporaryDirectory(prefix="hil-step-") as name:
        logs = [
            open_recorder(Path(name) / f"{side}.mcap", scenario, side)
            for side in ("plant", "controller")
        ]
        plant_loop = plant.build.make_loop(scenario, ends[0], logs[0])
        answering = controller.build.make_loop(scenario, ends[1], logs[1])
        prepare(scenario.realtime)
        try:
            tick, whole_us = _untimed(plant_loop, answering, ends, ticks)
            if compiled.in_force():  # the parts are timed from outside, which lets none in
                return whole_us
            _time_parts(plant_loop, answering, watch)
            assert isinstance(ends[0].link, MemoryLink)
            answer = watch.around(_ANSWER, answering.turn)
            ends[0].link.on_send = lambda: answer(ends[1].link.receive())
            turn = watch.around(_TURN, plant_loop.turn)
            for _ in range(ticks):
                watch.begin_tick()
                tick = turn(tick)
        finally:
            for log in logs:
                log.close()
    return whole_us


def _untimed(loop: Any, answering: Any, ends: Any, ticks: int) -> tuple[int, float]:  # noqa: ANN401
    """Run warm-up and plain ticks; return the next tick and the mean [us]."""
    ends[0].link.on_send = lambda: answering.turn(ends[1].link.receive())
    tick = 0
    while tick < _WARM_UP:
        tick = loop.turn(tick)
    start_ns = time.perf_counter_ns()
    while tick < _WARM_UP + ticks:
        tick = loop.turn(tick)
    return tick, (time.perf_counter_ns() - start_ns) / ticks * 1e-3


def _time_parts(loop: Any, answering: Any, watch: Stopwatch) -> None:  # noqa: ANN401
    """Put the stopwatch around the parts of both loops."""
    for timed, parts in ((loop, _PLANT_PARTS), (answering, _CONTROLLER_PARTS)):
        for name, part in parts.items():
            setattr(timed, name, watch.around(part, getattr(timed, name)))
        timed._put = watch.around(_RING, timed._put)  # noqa: SLF001  # timed from outside
    answering._encoder = _TimedEncoder(answering._encoder, watch)  # noqa: SLF001


def costs_of(watch: Stopwatch) -> list[Cost]:
    """Return the parts, the dearest first."""
    parts = sorted({part for tick in watch.ticks for part in tick})
    costs = []
    for part in parts:
        every = np.array([tick.get(part, 0) for tick in watch.ticks]) * 1e-3
        p50, p99 = np.percentile(every, [50, 99])
        costs.append(Cost(part, float(every.mean()), float(p50), float(p99)))
    return sorted(costs, key=lambda cost: -cost.mean_us)


def _print(console: Console, costs: list[Cost], whole_us: float) -> None:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("part of a tick [µs]", "mean", "p50", "p99"):
        table.add_column(title, justify="left" if "part" in title else "right")
    for part, *values in costs:
        table.add_row(part, *(f"{value:.1f}" for value in values))
    if costs:
        total = sum(cost.mean_us for cost in costs)
        table.add_row("sum, with the stopwatch", f"{total:.1f}", "", "")
    table.add_row("whole tick, without it", f"{whole_us:.1f}", "", "")
    console.print(table)
    if not costs:
        console.print("compiled loops; the parts are told by the interpreted: HIL_COMPILED=off")
    console.print(f"budget of a whole tick in lockstep over memory: {BUDGET_US:g} µs")
