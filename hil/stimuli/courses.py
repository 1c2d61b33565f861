"""The course of a stimulus: its value at a time from its beginning. Functions without memory."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Final

from hil.config.suite.stimulus import Stimulus
from hil.randoms import STIMULUS, normal_pair

MOST_SIGMAS: Final = 4.0
"""Noise stays within so many standard deviations, so that its range is known before the run."""


def value_at(given: Stimulus, t_s: float, base: float, tick: int, seed: int, number: int) -> float:
    """Return the value of a stimulus.

    Parameters: t_s : time from its beginning [s]
        base : what the parameter has without it
        tick : of the run; seed, number : of the run and of the stimulus, for noise
    """
    if given.kind == "ramp":
        return _ramp(given, t_s, base)
    if given.kind == "sine":
        middle = base if given.value is None else given.value
        angle = 2.0 * math.pi * (given.frequency_hz or 0.0) * t_s + (given.phase_rad or 0.0)
        return middle + (given.amplitude or 0.0) * math.sin(angle)
    if given.kind == "noise":
        return _noise(given, t_s, base, tick, seed, number)
    if given.kind == "playback":
        return _played(given, t_s)
    return given.value or 0.0


def own_end_s(given: Stimulus) -> float:
    """Return how long a stimulus takes by itself [s]; inf where it does not end."""
    if given.kind == "pulse":
        return given.width_s or 0.0
    if given.kind == "playback" and given.samples is not None:
        return given.samples[0][-1]
    return 0.0 if given.kind == "command" else math.inf


def extremes(given: Stimulus, base: float) -> tuple[float, float]:
    """Return the least and the most that a stimulus can be, so that it is checked before the run.

    Parameters: base : what the parameter has without it
    """
    middle = base if given.value is None else given.value
    if given.kind == "ramp":
        ends = (base if given.start is None else given.start, middle)
        return min(ends), max(ends)
    if given.kind in ("sine", "noise"):
        swing = abs(given.amplitude or 0.0) + MOST_SIGMAS * (given.sigma or 0.0)
        return middle - swing, middle + swing
    if given.kind == "playback" and given.samples is not None:
        values = [_scaled(given, value) for value in given.samples[1]]
        return min(values), max(values)
    return middle, middle


def _ramp(given: Stimulus, t_s: float, base: float) -> float:
    start = base if given.start is None else given.start
    end, over_s = given.value or 0.0, given.over_s or 1.0
    return end if t_s >= over_s else start + (end - start) * (t_s / over_s)


def _noise(given: Stimulus, t_s: float, base: float, tick: int, seed: int, number: int) -> float:
    index = tick if given.hold_s is None else int(t_s / given.hold_s)
    drawn, _ = normal_pair(seed, STIMULUS + number, index)
    middle = base if given.value is None else given.value
    return middle + (given.sigma or 0.0) * min(max(drawn, -MOST_SIGMAS), MOST_SIGMAS)


def _played(given: Stimulus, t_s: float) -> float:
    assert given.samples is not None
    times, values = given.samples
    after = bisect_right(times, t_s)
    if after == 0:
        return _scaled(given, values[0])
    if given.between != "line" or after == len(times):
        return _scaled(given, values[after - 1])
    before_s, after_s = times[after - 1], times[after]
    share = (t_s - before_s) / (after_s - before_s)
    return _scaled(given, values[after - 1] + (values[after] - values[after - 1]) * share)


def _scaled(given: Stimulus, value: float) -> float:
    scale = 1.0 if given.scale is None else given.scale
    return scale * value + (given.offset or 0.0)
