"""What believed samples show of a running engine: it stands still, its power contradicts them."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.observe.plausibility import NONE, OVERDUE, POWER, STANDS, UNBRAKED, Witness
from controller.observe.possible import Possible

SLOW: Final = 0.05
"""Of the mid-stroke speed: below it the piston turns, or stands."""

PUSHED: Final = 0.5
"""Of the amplitude: further out than this the springs let no piston rest."""

POWER_RATIO: Final = 12.0
POWER_MARGIN_W: Final = 40.0
"""Power beyond so many times c v^2 and this is not that of this velocity, nor of any load step."""

MOTORING_RATIO: Final = 1.3
MOTORING_MARGIN_M_S: Final = 0.15
"""Of a motor too: beyond so much more speed than is seen, at its greatest force."""

POWER_READINGS: Final[i64] = 2
UNBRAKED_READINGS: Final[i64] = 3
UNBRAKED_RATIO: Final = 0.02
UNBRAKED_SPEED: Final = 0.5
"""Of c v^2, and of the mid-stroke speed: less power at more speed is no generator's."""


def watch(
    possible: Possible, w: Witness, motion: Motion, v_m_s: float, power_w: float, load_n_s_m: float,
    since_ns: i64, generates: bool, has_burnt: bool, misfires: i64,
) -> tuple[Witness, i64]:  # fmt: skip
    """Look at what believed samples show of a running engine.

    Parameters: motion : up to the sample before; v_m_s : of this one; power_w : nan when this tick
    brought none; load_n_s_m : coefficient that is ordered; since_ns : time in this mode;
    generates : and is not motored; has_burnt : the charge of this stroke, as is known by now;
    misfires : in a row
    Returns: the witness, and the fault that is certain, or NONE
    """
    slow_ns, fault = _slowness(possible, w.slow_ns, motion, since_ns, generates and misfires == 0)
    power = w.power
    if not math.isnan(power_w):
        if generates:
            power = _power(power, motion.v_mid_m_s, v_m_s, power_w, load_n_s_m)
        else:
            power = _motoring_power(power, possible.force_n, v_m_s, power_w)
        if power >= POWER_READINGS:
            fault = POWER
        elif power <= -UNBRAKED_READINGS and has_burnt:
            fault = UNBRAKED
    if min(motion.t_ns - motion.dc_t_ns, since_ns) > possible.overdue_ns:
        fault = OVERDUE
    if slow_ns == w.slow_ns and power == w.power:
        return w, fault
    return Witness(
        w.t_ns, w.x_m, w.v_m_s, w.believed_x_m, w.drift_m, w.agreeing, w.refused_ns, w.doubt,
        slow_ns, power, w.leap_m_s,
    ), fault  # fmt: skip


def _slowness(
    possible: Possible, slow_ns: i64, motion: Motion, since_ns: i64, generates: bool
) -> tuple[i64, i64]:
    """Since when the piston has been slow, and whether that is too long."""
    if motion.direction == 0:
        return -1, STANDS if since_ns > possible.still_ns else NONE
    if abs(motion.v_m_s) >= SLOW * motion.v_mid_m_s or abs(motion.x_m) < PUSHED * possible.reach_m:
        return -1, NONE
    slow_ns = motion.t_ns if slow_ns < 0 else slow_ns
    most_ns = possible.dwell_ns if generates else possible.still_ns
    return slow_ns, STANDS if min(motion.t_ns - slow_ns, since_ns) > most_ns else NONE


def _power(count: i64, v_mid_m_s: float, v: float, power_w: float, load_n_s_m: float) -> i64:
    """Count the readings in a row that P = c v^2 does not explain, whatever the load has done."""
    braked_w = load_n_s_m * v * v
    if power_w > POWER_RATIO * braked_w + POWER_MARGIN_W:
        return max(count, 0) + 1
    fast = abs(v) > UNBRAKED_SPEED * v_mid_m_s and v_mid_m_s > 0.0
    if fast and power_w < UNBRAKED_RATIO * braked_w:
        return min(count, 0) - 1
    return 0


def _motoring_power(count: i64, force_n: float, v: float, power_w: float) -> i64:
    """Count the readings in a row beyond P = F v at the greatest force."""
    beyond = -power_w > force_n * (MOTORING_RATIO * abs(v) + MOTORING_MARGIN_M_S)
    return max(count, 0) + 1 if beyond else 0
