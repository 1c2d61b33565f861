"""Spark by position: when the piston will be where the charge is to be lit.

Towards the end of compression the gas ahead hardens faster than any oscillation tells, so that the
motion is carried on with it:  v' = -c v / m - K (L - x)^-gamma,  K from the last two samples.
"""

from __future__ import annotations

import math
from typing import Final

from controller.observe.estimate import Motion
from hil.config.prototypes import Prototype

_STEP_S: Final = 1.0e-4
_MOST_STEPS: Final = 250
_NEAREST_M: Final = 1.0e-4
_CLEAR_OF_MID: Final = 0.3
_FREE_MEAN_SPEED: Final = 2.0 / math.pi


def seconds_to_spark(
    engine: Prototype, motion: Motion, period_s: float, load_n_s_m: float, position_m: float,
    advance_s: float,
) -> float:  # fmt: skip
    """Time to the spark, told as time to a dead centre `advance_s` behind it.

    The spark is at the position, or `advance_s` before the piston would turn unfired if that is
    earlier: a stroke that falls short is lit nearer to mid-stroke.
    """
    reach, turn = predict(engine, motion, period_s, load_n_s_m, position_m)
    return min(reach + advance_s, turn)


def predict(
    engine: Prototype, motion: Motion, period_s: float, load_n_s_m: float, position_m: float
) -> tuple[float, float]:
    """Predict how long it is from the newest sample to a position, and to the turn unfired [s].

    Parameters: position_m : distance from mid-stroke, on the side that is ahead
    """
    L, gamma, c = engine.half_stroke_m, engine.gamma, load_n_s_m / engine.moving_mass_kg
    x, v = motion.z_m, motion.speed_m_s
    K, B = gas_and_drive(motion, 0.5 * period_s, L, gamma, c)
    spent, h, reach = 0.0, _STEP_S, -1.0
    for _ in range(_MOST_STEPS):
        slope = B - c * v - K * max(L - x, _NEAREST_M) ** -gamma
        v_mid, x_mid = v + 0.5 * h * slope, x + 0.5 * h * v
        v_next = v + h * (B - c * v_mid - K * max(L - x_mid, _NEAREST_M) ** -gamma)
        x_next = x + h * v_mid
        if reach < 0.0 and x_next >= position_m:
            reach = spent + max(position_m - x, 0.0) / v_mid
        if v_next <= 0.0:
            spent += h * v / (v - v_next)
            break
        x, v, spent = x_next, v_next, spent + h
    return (spent if reach < 0.0 else reach), spent


def gas_and_drive(
    motion: Motion, half_s: float, L: float, gamma: float, c: float
) -> tuple[float, float]:
    """K and B of  v' = B - c v - K (L - x)^-gamma,  from what was seen since mid-stroke.

    Two linear equations: the acceleration between the last two samples, and the kinetic energy
    lost since mid-stroke,  (v^2 - v_mid^2)/2 = B x - c <v> x - K [(L - x)^(1-gamma) - L^(1-gamma)]
    / (gamma - 1). B is what the machine drives, less friction. It is nought near mid-stroke, where
    the two hardly differ, and in a stroke that a charge has begun: burnt gas behind the piston does
    not push evenly.
    """
    x, v = motion.z_m, motion.speed_m_s
    a = float(motion.direction) * motion.a_m_s2
    x_then, v_then = x - v * half_s, v - a * half_s
    hardness = (L - x_then) ** -gamma
    lost = -a - c * v_then
    if _is_driven(motion) and x > _CLEAR_OF_MID * L:
        work = ((L - x) ** (1.0 - gamma) - L ** (1.0 - gamma)) / (gamma - 1.0)
        v_mid = motion.v_mid_m_s
        left = 0.5 * (v_mid * v_mid - v * v) - 0.5 * c * (v + v_mid) * x - lost * x
        K = -left / (hardness * x - work)
        if K > 0.0:
            return K, K * hardness - lost
    return max(lost, 0.0) / hardness, 0.0


def _is_driven(motion: Motion) -> bool:
    """Tell whether the machine has brought the piston to mid-stroke, and no charge.

    A free oscillation gets there with a mean speed of 2/pi of its speed at mid-stroke; one that a
    charge sets off is faster at once.
    """
    if not motion.passed_mid:
        return False
    took_s = float(motion.mid_t_ns - motion.dc_t_ns) * 1e-9
    return 0.0 < motion.tdc_m < _FREE_MEAN_SPEED * motion.v_mid_m_s * took_s
