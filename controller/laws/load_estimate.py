"""The load as it is, from electric power and velocity: scale = P / (c_commanded v^2).

A scalar Kalman filter whose measurement noise is that of the velocity, learnt from what the
filter leaves over. What that noise cannot explain is a load step, and is taken at once.
"""

from __future__ import annotations

from typing import NamedTuple

from hil.config.controller import LoadEstimateConfig

_WORST_SHARE = 9.0


class LoadEstimate(NamedTuple):
    """Actual over commanded load coefficient, its variance, and that of the velocity noise."""

    scale: float = 1.0
    variance: float = 1e-4
    noise_m2_s2: float = 1e-6


UNSURE = 1e-2
"""A variance beyond which nothing may be concluded from the scale."""


def update(
    config: LoadEstimateConfig, now: LoadEstimate, power_w: float, v: float, commanded: float
) -> LoadEstimate:
    """Take one measurement of the power.

    Parameters: v : velocity at the same instant [m/s]; commanded : load then in force [N s/m]
    """
    if abs(v) < config.slowest_m_s or commanded <= 0.0:
        return now
    scale, variance, noise = now
    full = commanded * v * v
    by_speed = 2.0 * scale / v
    by_grid = config.power_grid_w / full
    r = by_speed * by_speed * noise + by_grid * by_grid
    innovation = power_w / full - scale
    square = innovation * innovation
    variance += config.drift * config.drift
    s = variance + r
    if square > config.gate * config.gate * s and abs(innovation) > config.step_min:
        variance += square
        s = variance + r
    gain = variance / s
    spread = min(square / (by_speed * by_speed), _WORST_SHARE * noise)
    noise += config.noise_gain * (spread - noise)
    floor = config.noise_floor_m_s * config.noise_floor_m_s
    return LoadEstimate(
        scale + gain * innovation, variance * (1.0 - gain), noise if noise > floor else floor
    )
