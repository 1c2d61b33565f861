"""The load as it is, from electric power and velocity: scale = P / (c_commanded v^2).

A scalar Kalman filter whose measurement noise is that of the velocity, learnt from how what the
filter leaves over changes. What that noise cannot explain is a load step, and is taken at once.
"""

from __future__ import annotations

from typing import Final, final

from hil.config.motion.laws import LoadEstimateConfig
from hil.values import Value

_WORST_SHARE: Final = 9.0


@final
class LoadEstimation:
    """Section `load_estimate` of the configuration, read once for all ticks."""

    def __init__(self, config: LoadEstimateConfig) -> None:
        self.slowest_m_s = config.slowest_m_s
        self.power_grid_w = config.power_grid_w
        self.drift = config.drift
        self.gate = config.gate
        self.step_min = config.step_min
        self.noise_floor_m_s = config.noise_floor_m_s
        self.noise_gain = config.noise_gain
        self.retrim = config.retrim


@final
class LoadEstimate(Value):
    """Actual over commanded load coefficient, its variance, and that of the velocity noise.

    left_m_s: what the last measurement left over, as velocity
    """

    __slots__ = ("scale", "variance", "noise_m2_s2", "left_m_s")

    def __init__(
        self, scale: float = 1.0, variance: float = 1e-4, noise_m2_s2: float = 1e-6,
        left_m_s: float = 0.0,
    ) -> None:  # fmt: skip
        self.scale = scale
        self.variance = variance
        self.noise_m2_s2 = noise_m2_s2
        self.left_m_s = left_m_s

    @property
    def is_sure(self) -> bool:
        """Whether anything may be concluded from the scale."""
        return self.variance <= _UNSURE


@final
class LoadDrift(Value):
    """What a stroke adds to the load, as long as it goes on [N s/m].

    A step is there in one stroke and not in the next; of the last two changes from dead centre to
    dead centre the smaller one counts, and only while both have the same sign.

    at_n_s_m: load at the last dead centre, 0 before the first; last, lasting: the last change, and
    what of it has lasted
    """

    __slots__ = ("at_n_s_m", "last", "lasting")

    def __init__(self, at_n_s_m: float = 0.0, last: float = 0.0, lasting: float = 0.0) -> None:
        self.at_n_s_m = at_n_s_m
        self.last = last
        self.lasting = lasting

    def after(self, c: float) -> LoadDrift:
        """The drift at a dead centre with that load."""
        if self.at_n_s_m <= 0.0:
            return LoadDrift(c)
        last = c - self.at_n_s_m
        lasting = 0.0
        if last * self.last > 0.0:
            lasting = last if abs(last) < abs(self.last) else self.last
        if abs(lasting) < _STILL * c:
            lasting = 0.0
        return LoadDrift(c, last, lasting)


_STILL: Final = 1e-3
"""Change of the load in a stroke, as a share, that may be the estimate's own noise."""
NO_DRIFT: Final = LoadDrift()

AS_COMMANDED: Final = LoadEstimate()
UNKNOWN: Final = LoadEstimate(variance=1.0)
_UNSURE: Final = 1e-2


def update(
    config: LoadEstimation, now: LoadEstimate, power_w: float, v: float, commanded: float
) -> LoadEstimate:
    """Take one measurement of the power.

    Parameters: v : velocity at the same instant [m/s]; commanded : load then in force [N s/m]
    """
    if abs(v) < config.slowest_m_s or commanded <= 0.0:
        return now
    noise, variance = now.noise_m2_s2, now.variance + config.drift * config.drift
    full = commanded * v * v
    by_speed = 2.0 * now.scale / v
    by_grid = config.power_grid_w / full
    r = by_speed * by_speed * noise + by_grid * by_grid
    innovation = power_w / full - now.scale
    square = innovation * innovation
    if square > config.gate * config.gate * (variance + r) and abs(innovation) > config.step_min:
        variance += square
    gain = variance / (variance + r)
    # What a drift leaves over is much the same each time; only what changes is noise.
    left_m_s = innovation / by_speed
    apart = left_m_s - now.left_m_s
    spread = min(0.5 * apart * apart, _WORST_SHARE * noise)
    floor = config.noise_floor_m_s * config.noise_floor_m_s
    noise = max(noise + config.noise_gain * (spread - noise), floor)
    return LoadEstimate(now.scale + gain * innovation, variance * (1.0 - gain), noise, left_m_s)
