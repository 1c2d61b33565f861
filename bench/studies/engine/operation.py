"""The detailed engines at the operating points of the thesis: settled, part load, motored."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from bench.studies.engine.trace import Trace, cycle
from hil.config.detailed import Calibration, read
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import (
    Engine,
    Motion,
    at_rest,
    begin,
    engine_of,
    run_for,
    strokes,
)
from plant.engines.detailed.figures import Figures, cycle_rows, figures, settled
from plant.engines.detailed.types import Array

BAR: Final = 1e5
START_S, MOTORED_S = 1.5, 2.0
PART_LOADS: Final = (0.65, 0.75, 0.85, 0.95)
"""Loads of the Beijing engine (App. I Fig. 11, Table 2)."""


class Operation(NamedTuple):
    """An engine in settled running: figures, strokes of the last cycles, a cycle closely."""

    engine: Engine
    figures: Figures
    rows: Array
    trace: Trace
    contacts: int


def varied(c: Calibration, **tables: dict[str, Any]) -> Calibration:
    """Return a calibration with some values of its tables replaced, as `cycle={"kind": ...}`."""
    changed = {name: getattr(c, name).model_copy(update=values) for name, values in tables.items()}
    return c.model_copy(update=changed)


def operation_of(engine: Engine, motion: Motion) -> Operation:
    """Take figures and a cycle of a settled motion, which moves on."""
    found, rows = figures(engine, motion), cycle_rows(engine, motion)
    contacts = int(motion.d[at.CONTACTS])
    return Operation(engine, found, rows, cycle(engine, motion), contacts)


@lru_cache(maxsize=16)
def operate(c: Calibration) -> Operation:
    """Settle an engine at its nominal point.

    Raises: RunError when it stops
    """
    engine = engine_of(c)
    return operation_of(engine, settled(engine))


def part_load(c: Calibration, throttle: float, step: float = 0.05) -> tuple[Engine, Motion]:
    """Settle at full throttle, then close it in small steps, as an operator would."""
    motion = None
    for part in [*np.arange(1.0, throttle + 1e-9, -step).tolist(), throttle]:
        engine = engine_of(c, throttle=part)
        if motion is not None:
            motion.d[at.ENERGY] = engine.energy_j
        motion = settled(engine, 1.5, motion)
    assert motion is not None
    return engine, motion


def started(c: Calibration, force_n: float) -> Array:
    """Motor an engine from rest with a constant force; the rows of its strokes."""
    engine = engine_of(varied(c, cycle={"start_force_n": force_n}))
    motion = at_rest(engine)
    begin(engine, motion, 1)
    return strokes(run_for(engine, motion, START_S))


def starting_peaks(force_n: float, c: Calibration | None = None) -> list[float]:
    """Peak pressures of the right cylinder, cycle by cycle, motored from rest [bar]."""
    rows = started(read("bit-starting") if c is None else c, force_n)
    return [float(row[at.REC_P_RIGHT]) / BAR for row in rows if row[at.REC_X] < 0.0]


def motored() -> tuple[Engine, Motion]:
    """The Newcastle engine motored at constant speed (thesis section 4.1.3)."""
    engine = engine_of(read("nu-motoring"))
    motion = at_rest(engine)
    begin(engine, motion, 1)
    return engine, run_for(engine, motion, MOTORED_S)
