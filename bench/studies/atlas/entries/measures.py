"""What is read off a cycle of a motion: shapes and shares that the thesis tells in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.studies.engine.trace import Trace
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine

_MIDDLE_M = 5.0e-3
_GRID = np.linspace(-0.9, 0.9, 181)

Array = NDArray[np.float64]


def power_stroke(trace: Trace) -> tuple[Array, Array]:
    """Position and speed of the stroke that the trace begins with."""
    turns = np.flatnonzero(trace.v_m_s[1:] <= 0.0)
    end = int(turns[0]) + 1 if len(turns) else len(trace.v_m_s)
    return trace.x_m[:end], trace.v_m_s[:end]


def profile(trace: Trace) -> Array:
    """Speed over position of the power stroke, both as shares of their greatest values."""
    x, v = power_stroke(trace)
    middle, half = 0.5 * (x[0] + x[-1]), 0.5 * (x[-1] - x[0])
    found: Array = np.interp(_GRID, (x - middle) / half, v / np.max(v))
    return found


def shape_agreement(one: Trace, other: Trace) -> float:
    """Correlation of two power strokes' profiles."""
    return float(np.corrcoef(profile(one), profile(other))[0, 1])


def middle_flatness(trace: Trace) -> float:
    """Least speed within 5 mm of mid-stroke, as a share of the peak."""
    x, v = power_stroke(trace)
    return float(np.min(v[np.abs(x) < _MIDDLE_M]) / np.max(v))


def constant_volume(engine: Engine, trace: Trace) -> float:
    """Volume at which the heat is released in the mean, over the least volume.

    dQ = (gamma p dV + V dp) / (gamma - 1), where it is positive and the gas is enclosed
    """
    gamma = engine.p[at.GAMMA]
    p, volume = trace.p_pa, trace.volume_m3
    released = gamma * p[1:] * np.diff(volume) + volume[1:] * np.diff(p)
    near = volume[1:] < 2.0 * np.min(volume)
    weight = np.where(near & (released > 0.0), released, 0.0)
    return float(np.sum(weight * volume[1:]) / np.sum(weight) / np.min(volume))
