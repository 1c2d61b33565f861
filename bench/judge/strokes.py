"""Strokes of a run from the truth in the plant's log, and what follows from them alone."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.log import Log

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_CENTRE = ("dc_index", "dc_t_ns", "dc_x_m", "fuel_kg")


class Strokes(NamedTuple):
    """Every dead centre, exactly; all arrays have shape (strokes,).

    t_ns: its instant; x_m: its position; fuel_kg: what burnt there; tdc_ref_m: its set point
    """

    t_ns: Ints
    x_m: Floats
    fuel_kg: Floats
    tdc_ref_m: Floats

    @property
    def t_s(self) -> Floats:
        """Instants in seconds."""
        return np.multiply(self.t_ns, 1e-9, dtype=np.float64)

    @property
    def tdc_m(self) -> Floats:
        """Distances from mid-stroke."""
        return np.abs(self.x_m)

    @property
    def error_m(self) -> Floats:
        """How far beyond its set point each dead centre lies."""
        return self.tdc_m - self.tdc_ref_m

    def since(self, t_ns: float) -> Strokes:
        """Return the strokes that end at or after an instant."""
        return self.part(self.t_ns >= t_ns)

    def part(self, chosen: slice | NDArray[np.bool_]) -> Strokes:
        """Return some of the strokes."""
        t_ns, x_m, fuel_kg, tdc_ref_m = self
        return Strokes(t_ns[chosen], x_m[chosen], fuel_kg[chosen], tdc_ref_m[chosen])


class Truth(NamedTuple):
    """What one pass over the truth gives: strokes and totals."""

    strokes: Strokes
    ticks: int
    end_ns: int
    last_speed_m_s: float
    contacts: int


def read_truth(log: Log, tdc_ref_m: float, set_points: tuple[Ints, Floats]) -> Truth:
    """Gather the strokes in one pass; the dead centre that a settled run begins at is left out.

    Parameters: set_points : instants [ns] from which each set point [m] holds; tdc_ref_m before
    """
    centres: list[NDArray[Any]] = []
    ticks, end_ns, speed, contacts, last = 0, log.end_ns, 0.0, 0, -1
    for block in log.blocks("/truth"):
        index = block["dc_index"].astype(np.int64)
        if last < 0:
            last = int(index[0])
        new = np.flatnonzero(np.diff(index, prepend=last))
        centres.append(np.stack([block[name][new].astype(np.float64) for name in _CENTRE[1:]]))
        last = int(index[-1])
        ticks += len(block)
        end_ns, contacts = int(block["t_ns"][-1]), int(block["contacts"][-1])
        speed = abs(float(block["v_m_s"][-1]))
    t_ns, x_m, fuel_kg = np.concatenate(centres, axis=1) if centres else np.empty((3, 0))
    whole = np.rint(t_ns).astype(np.int64)
    refs = set_point_at(whole, tdc_ref_m, set_points)
    return Truth(Strokes(whole, x_m, fuel_kg, refs), ticks, end_ns, speed, contacts)


def set_point_at(t_ns: Ints, first_m: float, changes: tuple[Ints, Floats]) -> Floats:
    """Return the set point that holds at each instant, `first_m` before the first change."""
    at_ns, value_m = changes
    values = np.concatenate([[first_m], value_m])
    return values[np.searchsorted(at_ns, t_ns, side="right")]


def set_points(log: Log) -> tuple[Ints, Floats]:
    """Return when each set point was first reported by a stroke, and its value [m]."""
    rows = log.array("/stroke")
    ref = rows["tdc_ref_m"]
    new = np.flatnonzero(np.diff(ref, prepend=np.nan) != 0.0)
    return rows["t_ns"][new].astype(np.int64), ref[new].astype(np.float64)


def whole_cycles(strokes: Strokes, length: int, least: int | None = None) -> Strokes:
    """Return the dead centres that begin and end the last whole cycles; one less than two of none.

    Parameters: length : strokes after which all repeats, two at least: a period of the motion
        least : take no more cycles than have so many strokes; None for all
    """
    cycle = math.lcm(2, length)
    count = (len(strokes.t_ns) - 1) // cycle * cycle
    if least is not None:
        count = min(count, math.ceil(least / cycle) * cycle)
    return strokes.part(slice(max(len(strokes.t_ns) - 1 - count, 0), None))


def frequency_hz(strokes: Strokes) -> float | None:
    """Mean frequency of the motion over whole cycles; two strokes are one period."""
    if len(strokes.t_ns) < 2:
        return None
    duration_s = float(strokes.t_ns[-1] - strokes.t_ns[0]) * 1e-9
    return 0.5 * (len(strokes.t_ns) - 1) / duration_s
