"""Expectations on a signal: bounds, tolerance, rise, settling, overshoot. Arithmetic of arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from bench.judge.strokes import Floats
from bench.judge.traces import Trace
from bench.judge.window import Judged

_LOW, _HIGH = 0.1, 0.9


class Part(NamedTuple):
    """The judged stretch of a signal.

    trace: its values there, one at least; before: the value that it began with
    reference: what it is compared with, at the same instants; None without any
    origin_ns: what times count from
    """

    trace: Trace
    before: float
    reference: Floats | None
    origin_ns: int

    @property
    def final(self) -> float:
        """The value that it is to come to: its reference at the end, or its own last value."""
        values = self.trace.value if self.reference is None else self.reference
        return float(values[-1])

    def after_s(self, index: int) -> float:
        """Time of a value from the beginning."""
        return (int(self.trace.t_ns[index]) - self.origin_ns) * 1e-9


def low(part: Part, bound: float, statistic: str | None) -> Judged:
    """Nowhere below."""
    return _bound(part, bound, statistic, -1.0)


def high(part: Part, bound: float, statistic: str | None) -> Judged:
    """Nowhere above."""
    return _bound(part, bound, statistic, 1.0)


def _bound(part: Part, bound: float, statistic: str | None, sign: float) -> Judged:
    if statistic is not None:
        found = STATISTICS[statistic](part.trace.value)
        return found, sign * found <= sign * bound, f"{found:.6g}"
    index = int(np.argmax(sign * part.trace.value))
    found = float(part.trace.value[index])
    met = sign * found <= sign * bound
    if met:
        return found, True, f"{found:.6g}"
    first = int(np.flatnonzero(sign * part.trace.value > sign * bound)[0])
    return found, False, f"{found:.6g}, first at {int(part.trace.t_ns[first]) * 1e-9:.4f} s"


STATISTICS: Final[dict[str, Callable[[Floats], float]]] = {
    "mean": lambda values: float(values.mean()),
    "rms": lambda values: math.sqrt(float(np.square(values).mean())),
    "final": lambda values: float(values[-1]),
    "peak-to-peak": lambda values: float(np.ptp(values)),
    "spread": lambda values: float(values.std()),
}


def deviation(part: Part, tolerance: float, *, relative: bool) -> Judged:
    """Nowhere further from the reference than the tolerance."""
    assert part.reference is not None
    away = np.abs(part.trace.value - part.reference)
    if relative:
        away = away / np.maximum(np.abs(part.reference), np.finfo(float).tiny)
    index = int(np.argmax(away))
    found = float(away[index])
    at_s = int(part.trace.t_ns[index]) * 1e-9
    return found, found <= tolerance, f"{found:.4g} at {at_s:.4f} s"


def reached_s(part: Part, least: float | None, most: float | None) -> float | None:
    """Time until the signal is within its bounds for the first time; None when never."""
    value = part.trace.value
    inside = np.ones(len(value), bool)
    if least is not None:
        inside &= value >= least
    if most is not None:
        inside &= value <= most
    return part.after_s(int(np.argmax(inside))) if inside.any() else None


def rise_s(part: Part) -> float | None:
    """Time from a tenth to nine tenths of the way to the final value; None without a way."""
    share = _share(part)
    if share is None or not (share >= _HIGH).any():
        return None
    high_index = int(np.argmax(share >= _HIGH))
    low_index = int(np.argmax(share >= _LOW))
    t_ns = part.trace.t_ns
    return int(t_ns[high_index] - t_ns[low_index]) * 1e-9


def overshoot(part: Part) -> float | None:
    """Share of the step by which the signal goes beyond its final value; None without a step."""
    share = _share(part)
    return None if share is None else max(float(share.max()) - 1.0, 0.0)


def _share(part: Part) -> Floats | None:
    """Share of the way from the first value to the final one that is behind."""
    way = part.final - part.before
    return None if way == 0.0 else (part.trace.value - part.before) / way


def settling_s(part: Part, tolerance: float, *, relative: bool) -> float | None:
    """Time to the first value after the last one outside the band; None when that is the last."""
    band = tolerance * abs(part.final) if relative else tolerance
    target = part.final if part.reference is None else part.reference
    outside = np.flatnonzero(np.abs(part.trace.value - target) > band)
    if not len(outside):
        return 0.0
    first = int(outside[-1]) + 1
    return part.after_s(first) if first < len(part.trace.value) else None
