"""Plant and controller in one process and one thread, over the memory link."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import controller.build
import controller.follow
import plant.build
from bench.run import lockstep
from drivers.channels import MemoryStatus
from drivers.links import open_memory
from drivers.system.clock import SystemClock
from drivers.system.process import Stop, guarded, last_words, open_recorder
from drivers.system.realtime import prepare
from hil.config.resolved import Resolved, read_resolved
from plant.status import facts, raise_if_lost

_TELL_EVERY_S = 0.1
_LOOK_EVERY = 50
"""Ticks between two looks whether the run is to end."""


def run(scenario: Resolved, plant_log: Path | None, controller_log: Path | None) -> int:
    """Run both loops in turn: the controller answers inside the plant's send.

    Raises: ConfigError
    """
    stop = Stop()
    stop.listen()
    plant_end, controller_end = open_memory()
    recorders = (
        open_recorder(plant_log, scenario, "plant"),
        open_recorder(controller_log, scenario, "controller"),
    )
    try:
        clock = SystemClock(scenario.realtime.spin_s, scenario.loop.period_ns)
        pacer = plant.build.make_pacer(scenario, clock)
        plant_loop = plant.build.make_loop(scenario, plant_end, recorders[0], pacer)
        pacer = controller.build.make_pacer(scenario, SystemClock(scenario.realtime.spin_s))
        controller_loop = controller.build.make_loop(scenario, controller_end, recorders[1], pacer)
        lockstep.join(plant_end.link, controller_end.link, controller_loop)
        for name, end in (("plant", plant_end), ("controller", controller_end)):
            assert isinstance(end.status, MemoryStatus)
            end.status.on_publish = _tell_of(name)
        granted = prepare(scenario.realtime, lockstep=scenario.loop.clock == "lockstep")
        start_s = time.perf_counter()
        tick, ticks = 0, scenario.ticks
        while tick < ticks and not stop.requested:
            tick = lockstep.run_ticks(plant_loop, tick, min(tick + _LOOK_EVERY, ticks))
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
            "loop_s": loop_s,
            "times_real_time": tick / scenario.loop.rate_hz / loop_s,
        }
    )
    raise_if_lost(plant_loop)
    return 0


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
