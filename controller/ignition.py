"""Spark by position: when the piston will be where the charge is to be lit.

Towards the end of compression the gas ahead hardens faster than any oscillation tells, so that the
motion is carried on with it:  v' = -c v / m - K (L - x)^-gamma,  K from the last two samples.
"""

from __future__ import annotations

from collections.abc import Callable

from controller.estimate import Motion
from hil.prototypes import Prototype

_STEP_S = 1.0e-4
_MOST_STEPS = 250
_NEAREST_M = 1.0e-4


def ahead_of(
    engine: Prototype, motion: Motion, period_s: float, load_n_s_m: float, position_m: float,
    advance_s: float,
) -> Callable[[], float]:  # fmt: skip
    """Time to the spark, told as time to a dead centre `advance_s` behind it.

    The spark is at the position, or `advance_s` before the piston would turn unfired if that is
    earlier: a stroke that falls short is lit nearer to mid-stroke.
    """

    def ahead() -> float:
        reach, turn = predict(engine, motion, period_s, load_n_s_m, position_m)
        return min(reach + advance_s, turn)

    return ahead


def predict(
    engine: Prototype, motion: Motion, period_s: float, load_n_s_m: float, position_m: float
) -> tuple[float, float]:
    """Predict how long it is from the newest sample to a position, and to the turn unfired [s].

    Parameters: position_m : distance from mid-stroke, on the side that is ahead
    """
    L, gamma, c = engine.half_stroke_m, engine.gamma, load_n_s_m / engine.moving_mass_kg
    x, v = motion.direction * motion.x_m, motion.direction * motion.v_m_s
    half = 0.5 * period_s
    a = motion.direction * motion.a_m_s2
    x_then, v_then = x - v * half, v - a * half
    K = max(-a - c * v_then, 0.0) * (L - x_then) ** gamma
    spent, h, reach = 0.0, _STEP_S, -1.0
    for _ in range(_MOST_STEPS):
        slope = -c * v - K * max(L - x, _NEAREST_M) ** -gamma
        v_mid, x_mid = v + 0.5 * h * slope, x + 0.5 * h * v
        v_next = v + h * (-c * v_mid - K * max(L - x_mid, _NEAREST_M) ** -gamma)
        x_next = x + h * v_mid
        if reach < 0.0 and x_next >= position_m:
            reach = spent + max(position_m - x, 0.0) / v_mid
        if v_next <= 0.0:
            spent += h * v / (v - v_next)
            break
        x, v, spent = x_next, v_next, spent + h
    return (spent if reach < 0.0 else reach), spent
