"""Plant and controller in one process and one thread, over the memory link."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import controller.build
import controller.follow
import plant.build
from bench.run import offline
from controller.loop import ControllerLoop
from drivers.channels import MemoryStatus
from drivers.links import Connection, open_memory
from drivers.memory_link import MemoryLink, nothing
from drivers.recorder.client import NullRecorder, Recorder
from drivers.system.clock import SystemClock
from drivers.system.log import open_recorder
from drivers.system.process import Stop, brake, guarded, last_words
from drivers.system.realtime import prepare
from hil.config.resolved import Resolved, read_resolved
from plant.loop import PlantLoop
from plant.status import facts, is_safe, raise_if_lost

_TELL_EVERY_S = 0.1
_LOOK_EVERY = 50
"""Ticks between two looks whether the run is to end."""

Recorders = tuple[Recorder | NullRecorder, Recorder | NullRecorder]


def run(scenario: Resolved, plant_log: Path | None, controller_log: Path | None) -> int:
    """Run both loops in turn: the controller answers inside the plant's send.

    Raises: ConfigError
    """
    stop = Stop()
    stop.listen()
    plant_end, controller_end = open_memory()
    recorders = (
        open_recorder(plant_log, scenario, "plant", live=True),
        open_recorder(controller_log, scenario, "controller", live=True),
    )
    _watch(recorders, scenario, stop)
    try:
        plant_loop, controller_loop, ends = _joined(
            scenario, (plant_end, controller_end), recorders
        )
        granted = prepare(scenario.realtime, lockstep=scenario.loop.clock == "lockstep")
        start_s = time.perf_counter()
        tick = _turn_until(plant_loop, scenario.ticks, stop)
        if stop.cause:
            tick = _to_safe_state(plant_loop, controller_loop, ends, recorders, stop)
        loop_s = time.perf_counter() - start_s
    finally:
        with contextlib.ExitStack() as closing:  # each is closed, whatever another one says
            for recorder in recorders:
                closing.callback(recorder.close)
    last_words(
        {
            "plant": facts(plant_loop, plant_end, tick),
            "controller": controller.follow.facts(controller_loop, controller_end.link),
            "granted": granted,
            **stop.facts(),
            "loop_s": loop_s,
            "times_real_time": tick / scenario.loop.rate_hz / loop_s,
        }
    )
    stop.raise_if_caused()
    _raise_if_failed(plant_loop, recorders)
    return 0


def _joined(
    scenario: Resolved, connections: tuple[Connection, Connection], recorders: Recorders
) -> tuple[PlantLoop, ControllerLoop, tuple[MemoryLink, MemoryLink]]:
    """Return both loops, the controller's turn at the end of the plant's send, and their link."""
    plant_end, controller_end = connections
    clock = SystemClock(scenario.realtime.spin_s, scenario.loop.period_ns)
    pacer = plant.build.make_pacer(scenario, clock)
    plant_loop = plant.build.make_loop(scenario, plant_end, recorders[0], pacer)
    pacer = controller.build.make_pacer(scenario, SystemClock(scenario.realtime.spin_s))
    controller_loop = controller.build.make_loop(scenario, controller_end, recorders[1], pacer)
    for name, end in (("plant", plant_end), ("controller", controller_end)):
        assert isinstance(end.status, MemoryStatus)
        end.status.on_publish = _tell_of(name)
    silences = offline.silences_of(scenario)
    links = offline.join(plant_end.link, controller_end.link, controller_loop, silences)
    return plant_loop, controller_loop, links


def _watch(recorders: Recorders, scenario: Resolved, stop: Stop) -> None:
    for recorder in recorders:
        recorder.watch(scenario.log.recorder_lost, stop.end)


def _turn_until(loop: PlantLoop, ticks: int, stop: Stop) -> int:
    """Run for so many ticks, or until it is asked to end; returns the tick reached."""
    tick = 0
    while tick < ticks and not stop.requested:
        tick = offline.run_ticks(loop, tick, min(tick + _LOOK_EVERY, ticks))
    return tick


def _to_safe_state(
    plant_loop: PlantLoop, controller_loop: ControllerLoop, ends: tuple[MemoryLink, MemoryLink],
    recorders: Recorders, stop: Stop,
) -> int:  # fmt: skip
    """Let the controller miss the plant and brake, then the plant miss the controller."""
    tick = controller_loop.tick + 1
    last_tick = tick + controller_loop.params.bounds.stale_ticks

    def turn_deaf() -> None:
        ends[1].receive()
        controller_loop.turn(None)

    def turn() -> bool:
        nonlocal tick
        if tick > last_tick:
            ends[0].on_send = nothing
        tick = plant_loop.turn(tick)
        return is_safe(plant_loop)

    ends[0].on_send = turn_deaf
    t_ns = tick * plant_loop.params.period_ns
    brake(stop, recorders[1], tick, t_ns, lambda: True)
    brake(stop, recorders[0], tick, t_ns, turn)
    return tick


def _raise_if_failed(loop: PlantLoop, recorders: Sequence[Recorder | NullRecorder]) -> None:
    raise_if_lost(loop)
    for recorder in recorders:
        recorder.raise_if_cut()


def _tell_of(name: str) -> Callable[[Mapping[str, object]], None]:
    """A status sink that prints, but no oftener than anybody looks."""
    next_s = time.monotonic() + _TELL_EVERY_S

    def tell(status: Mapping[str, object]) -> None:
        nonlocal next_s
        now_s = time.monotonic()
        if now_s >= next_s:
            next_s = now_s + _TELL_EVERY_S
            last_words({"process": name, **status})

    return tell


def main() -> int:
    """Entry point of `python -m bench.run.single_process`."""
    parser = argparse.ArgumentParser(prog="single")
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--plant-log", type=Path)
    parser.add_argument("--controller-log", type=Path)
    given = parser.parse_args()
    return guarded(lambda: run(read_resolved(given.config), given.plant_log, given.controller_log))


if __name__ == "__main__":
    sys.exit(main())
