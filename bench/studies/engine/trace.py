"""One cycle of a settled detailed engine, sampled closely: what the thesis's diagrams show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hil.errors import RunError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine, Motion
from plant.engines.detailed.kernel import pressure
from plant.engines.detailed.solver import advance, scratch
from plant.engines.detailed.types import Array

_SAMPLE_S = 5.0e-5
_LONGEST_S = 2.0


class Trace(NamedTuple):
    """Arrays of shape (samples,), from a dead centre on; the gas is that of the left cylinder.

    force_n: of the machine as it is ordered, load and motor; of a speed servo 0
    """

    t_s: Array
    x_m: Array
    v_m_s: Array
    p_pa: Array
    volume_m3: Array
    force_n: Array


def cycle(engine: Engine, motion: Motion) -> Trace:
    """Follow the motion, in place, through one cycle that begins with the left power stroke.

    Raises: RunError when no such cycle begins
    """
    y, d, record = motion
    first = 2.0 if engine.calibration.cycle.kind == "four-stroke" else 0.0
    work, end = scratch(), d[at.T] + _LONGEST_S
    while d[at.T] < end:
        advance(engine.p, d, y, engine.programme, work, record, end, True)
        if d[at.PHASE] == first:
            return _sample(engine, motion)
    raise RunError(f"{engine.calibration.name}: no cycle begins within {_LONGEST_S:g} s")


def _sample(engine: Engine, motion: Motion) -> Trace:
    y, d, record = motion
    work, begun, rows = scratch(), d[at.T], d[at.ROWS]
    length = engine.programme.shape[0]
    samples = []
    while d[at.ROWS] < rows + length and d[at.T] < begun + _LONGEST_S:
        force = d[at.FORCE] - d[at.LOAD] * d[at.LOAD_SCALE] * y[at.V]
        samples.append((d[at.T] - begun, y[at.X], y[at.V], pressure(engine.p, y, 0), force))
        until = begun + len(samples) * _SAMPLE_S
        advance(engine.p, d, y, engine.programme, work, record, until, False)
    t, x, v, p, force = np.array(samples).T
    side = engine.p[at.CYL_P : at.CYL_P + at.CYL_P_STRIDE]
    return Trace(t, x, v, p, side[at.AREA] * (side[at.LENGTH] + x), force)
