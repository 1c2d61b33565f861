"""Synthetic runs for tests of the bench: logs with known dead centres, events and ticks."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.run.directory import RunFiles
from bench.run.scenarios import read
from drivers.recorder.client import Recorder
from hil.config.scenario import Scenario
from hil.log import topics

PERIOD_NS = 1_000_000


class Centre(NamedTuple):
    """A dead centre to put into a log."""

    t_ns: int
    x_m: float
    fuel_kg: float = 2.8e-6


class Made(NamedTuple):
    """What a synthetic run consists of."""

    centres: list[Centre]
    ticks: int = 1000
    events: tuple[tuple[int, str, str], ...] = ()
    controller_events: tuple[tuple[int, str, str], ...] = ()
    late_ns: tuple[int, ...] = (0,)
    age: int = 1
    missed: frozenset[int] = frozenset()
    tdc_ref_m: float = 0.0155


def make_run(directory: Path, made: Made, **overrides: object) -> tuple[Scenario, RunFiles]:
    """Write both logs of a run of `load-decrease` with what was asked for."""
    changes = [(key.replace("__", "."), value) for key, value in overrides.items()]
    scenario = read("load-decrease", [("controller.tdc_ref_m", made.tdc_ref_m), *changes])
    files = RunFiles(directory)
    files.scenario.write_text(scenario.model_dump_json())
    _write_plant(files.plant_log, made)
    _write_controller(files.controller_log, made)
    return scenario, files


def _write_plant(path: Path, made: Made) -> None:
    log = Recorder.open(path, {}, blocking=True)
    for tick in range(made.ticks):
        t_ns = tick * PERIOD_NS
        past = [c for c in made.centres if c.t_ns <= t_ns]
        last = past[-1] if past else Centre(0, 0.0, 0.0)
        v_m_s = float(np.cos(tick / 8.0))
        truth = topics.TRUTH.pack(
            tick,
            t_ns,
            0.0,
            v_m_s,
            last.fuel_kg,
            810.0,
            0,
            len(past),
            last.t_ns,
            last.x_m,
            0,
            1.4,
            1.3e5,
        )
        sensor = topics.SENSOR.pack(tick, t_ns, 0.0, v_m_s, 1e5, 1e5, 100.0, 0)
        log.put(truth + (b"" if tick in made.missed else sensor) + _timing(tick, made))
    for t_ns, code, text in made.events:
        log.put(topics.EVENT.pack(t_ns // PERIOD_NS, t_ns, 0, code, text))
    log.close()


def _timing(tick: int, made: Made) -> bytes:
    t_ns = tick * PERIOD_NS
    missed = tick in made.missed
    woke_ns = t_ns + made.late_ns[tick % len(made.late_ns)]
    used = -1 if missed or tick < made.age else tick - made.age
    return topics.TIMING.pack(tick, t_ns, t_ns, woke_ns, woke_ns + 20_000, used, missed)


def _write_controller(path: Path, made: Made) -> None:
    log = Recorder.open(path, {}, blocking=True)
    for tick in range(made.ticks):
        log.put(_timing(tick, made))
    for index, centre in enumerate(made.centres, 1):
        tick = centre.t_ns // PERIOD_NS + 1
        side = 1 if centre.x_m > 0.0 else 0
        log.put(
            topics.STROKE.pack(
                index, tick, tick * PERIOD_NS, side, abs(centre.x_m), made.tdc_ref_m,
                1.94, 1.94, 2.8e-6, 0.0, 0.0, 0.0, 0.0, 19.9, 1500.0, 0.0, 1.4,
            )
        )  # fmt: skip
    for t_ns, code, text in made.controller_events:
        log.put(topics.EVENT.pack(t_ns // PERIOD_NS, t_ns, 0, code, text))
    log.close()


def alternating(errors_mm: list[float], stroke_ns: int = 25_000_000) -> list[Centre]:
    """Dead centres left and right in turn, with these errors to 15.5 mm, after a first one."""
    centres = [Centre(0, -0.0155)]
    for number, error in enumerate(errors_mm, 1):
        side = 1 if number % 2 else -1
        centres.append(Centre(number * stroke_ns, side * (0.0155 + error * 1e-3)))
    return centres
