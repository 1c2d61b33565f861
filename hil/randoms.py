"""Random numbers that are a function of (seed, stream, index): no state, no history."""

from __future__ import annotations

import math
from functools import cache

EFFICIENCY = 1
SENSOR = 2
VALVE = 3
INJECTOR = 4
SPARK = 5
STIMULUS = 16
"""Streams; of stimuli this and those after it."""

_MASK = (1 << 64) - 1
_TO_UNIT = 2.0**-53


def _mix(z: int) -> int:
    """Scramble 64 bits (the finaliser of SplitMix64)."""
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


@cache
def _key(seed: int, stream: int) -> int:
    return _mix((seed * 0x9E3779B97F4A7C15 + stream) & _MASK)


def uniform(seed: int, stream: int, index: int) -> float:
    """Return the number of that seed, stream and index, uniform in [0, 1)."""
    return (_mix((_key(seed, stream) + index * 0x9E3779B97F4A7C15) & _MASK) >> 11) * _TO_UNIT


def normal_pair(seed: int, stream: int, index: int) -> tuple[float, float]:
    """Return two independent standard normal numbers (Box and Muller)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(seed, stream, 2 * index)))
    angle = 2.0 * math.pi * uniform(seed, stream, 2 * index + 1)
    return radius * math.cos(angle), radius * math.sin(angle)
