"""The load with which a run begins that has a target power: by the plant's own model."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from controller.supervision.performance import LOAD_MAX_N_S_M, Reach, Steady, SteadyLimits
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.errors import ConfigError
from hil.roots import secant

_STEPS = 30
_PRECISION = 1.0e-9
_LEAST_N_S_M: Final = 0.1
_STRIDE: Final = 1.25

Model = Callable[[float], Steady]
"""Load [N s/m] -> settled running at the set point; raises ConfigError where there is none."""


def start_load(
    given: ControllerConfig, engine: Prototype, period_s: float, guess_n_s_m: float, at: Model,
    relative: float = _PRECISION,
) -> Reach:  # fmt: skip
    """Return the load that delivers the target power, or the nearest to it, and what limits it.

    Parameters: relative : last step towards it, as a share
    """
    target_w = given.supervisory.target_power_w
    assert target_w is not None, "asked only where there is a target"
    limits, throttle = SteadyLimits(given, engine, period_s), given.supervisory.throttle

    def room(load: float) -> float:
        try:
            return 1.0 - limits.tightest(at(load), load, throttle)[0]
        except ConfigError:
            return -1.0

    def missing(load: float) -> float:
        return at(load).power_w - target_w

    try:
        load = secant(missing, guess_n_s_m, steps=_STEPS, relative=relative)
    except ConfigError:  # somewhere on the way the engine does not run
        most = _edge(room, guess_n_s_m, relative)
        if missing(most) <= 0.0:
            return Reach(most, limits.tightest(at(most), most, throttle)[1])
        load = _edge(lambda load: -missing(load), most / _STRIDE, relative)
    load = min(max(load, _LEAST_N_S_M), LOAD_MAX_N_S_M)
    if room(load) < 0.0:
        most = _edge(room, load, relative)
        return Reach(most, limits.tightest(at(most), most, throttle)[1])
    least_kg = given.limits.fuel_min_kg
    if at(load).fuel_kg < least_kg:
        least = _edge(lambda load: least_kg - at(load).fuel_kg, load, relative)
        return Reach(least, f"limits.fuel_min_kg, {least_kg * 1e6:g} mg")
    return Reach(load, "")


def _edge(f: Callable[[float], float], load_n_s_m: float, relative: float) -> float:
    """The load up to which f is not negative, looked for from one near it [N s/m]."""
    low, high = load_n_s_m, load_n_s_m * _STRIDE
    while f(low) < 0.0 and low > _LEAST_N_S_M:
        low, high = low / _STRIDE, low
    while high < LOAD_MAX_N_S_M and f(high) >= 0.0:
        low, high = high, high * _STRIDE
    while high > low * (1.0 + relative):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if f(middle) >= 0.0 else (low, middle)
    return low
