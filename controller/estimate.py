"""From samples to strokes: dead centres and mid-stroke speeds between the ticks.

A sample gives position and velocity at a tick; what the layers need happens between two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

AMPLITUDE_MIN_M = 0.5e-3
"""A reversal nearer to mid-stroke than this is no dead centre that could be fired."""

SPEED_MIN_M_S = 5e-3
"""Below this the direction of motion is not judged."""


class Motion(NamedTuple):
    """What is known of the motion.

    direction: +1 to the right head, -1 to the left, 0 not moving yet
    t_ns, x_m, v_m_s: newest sample; a_m_s2: acceleration between the last two
    tdc_m, side, dc_t_ns: last dead centre as distance, its head (0 left, 1 right), its instant
    v_mid_m_s, mid_t_ns: last pass through the middle
    quarter_ns: from there to the dead centre, in the last stroke that had both
    stroke: number of the stroke; passed_mid: whether this stroke has passed the middle
    """

    direction: int = 0
    t_ns: int = -1
    x_m: float = 0.0
    v_m_s: float = 0.0
    a_m_s2: float = 0.0
    tdc_m: float = 0.0
    side: int = 0
    dc_t_ns: int = -1
    v_mid_m_s: float = 0.0
    mid_t_ns: int = -1
    stroke: int = 0
    passed_mid: bool = False
    quarter_ns: int = 0


class Passed(NamedTuple):
    """What lies between the last two samples."""

    dead_centre: bool = False
    mid_stroke: bool = False


NOTHING = Passed()
DEAD_CENTRE = Passed(dead_centre=True)
MID_STROKE = Passed(mid_stroke=True)


def update(motion: Motion, t_ns: int, x: float, v: float) -> tuple[Motion, Passed]:
    """Take one sample.

    Parameters: t_ns : time of the sample; x, v : position [m], velocity [m/s]
    Returns: the motion and what was passed since the last sample
    """
    direction = motion.direction
    if direction == 0 or motion.t_ns < 0:
        return _first(motion, t_ns, x, v), NOTHING
    h = (t_ns - motion.t_ns) * 1e-9
    a = (v - motion.v_m_s) / h
    if direction * v < 0.0:
        return _reversed(motion, t_ns, x, v, a)
    if not motion.passed_mid and direction * x >= 0.0:
        return _crossed(motion, t_ns, x, v, a)
    return Motion(direction, t_ns, x, v, a, *motion[5:]), NOTHING


def _first(motion: Motion, t_ns: int, x: float, v: float) -> Motion:
    """Without a direction: take the sample, and the direction once it can be told."""
    direction = motion.direction
    if direction == 0 and abs(v) > SPEED_MIN_M_S:
        direction = 1 if v > 0.0 else -1
    return motion._replace(
        direction=direction, t_ns=t_ns, x_m=x, v_m_s=v, passed_mid=direction * x > 0.0
    )


def _reversed(motion: Motion, t_ns: int, x: float, v: float, a: float) -> tuple[Motion, Passed]:
    """The velocity has changed its sign: a dead centre, if it is one worth the name."""
    dc_t_ns, dc_x = dead_centre_between(motion.t_ns, motion.x_m, motion.v_m_s, t_ns, x, v)
    turned = motion._replace(
        direction=-motion.direction, t_ns=t_ns, x_m=x, v_m_s=v, a_m_s2=a, passed_mid=False
    )
    if motion.direction * dc_x < AMPLITUDE_MIN_M:
        return turned._replace(passed_mid=turned.direction * x > 0.0), NOTHING
    return (
        turned._replace(
            tdc_m=abs(dc_x),
            side=1 if dc_x > 0.0 else 0,
            dc_t_ns=dc_t_ns,
            stroke=motion.stroke + 1,
            quarter_ns=dc_t_ns - motion.mid_t_ns if motion.passed_mid else 0,
        ),
        DEAD_CENTRE,
    )


def _crossed(motion: Motion, t_ns: int, x: float, v: float, a: float) -> tuple[Motion, Passed]:
    """The piston has passed the middle of its stroke."""
    mid_t_ns, v_mid = crossing_between(motion.t_ns, motion.x_m, motion.v_m_s, t_ns, x, v)
    return (
        motion._replace(
            t_ns=t_ns, x_m=x, v_m_s=v, a_m_s2=a, v_mid_m_s=abs(v_mid), mid_t_ns=mid_t_ns,
            passed_mid=True,
        ),
        MID_STROKE,
    )  # fmt: skip


def dead_centre_between(
    t1_ns: int, x1: float, v1: float, t2_ns: int, x2: float, v2: float
) -> tuple[int, float]:
    """Instant and position of the dead centre between two samples of opposite velocity.

    With a constant acceleration on each side, which may differ (combustion changes it at the dead
    centre itself), x_dc = x1 + v1 s / 2 = x2 - v2 (h - s) / 2, which is linear in s. The error is
    j s^3 / 12, under 4 um for a tick of 1 ms in the worst excitation, and noise is not amplified.
    """
    h = (t2_ns - t1_ns) * 1e-9
    s = 2.0 * (x2 - x1 - 0.5 * v2 * h) / (v1 - v2)
    s = min(max(s, 0.0), h)
    return t1_ns + round(s * 1e9), x1 + 0.5 * v1 * s


def crossing_between(
    t1_ns: int, x1: float, v1: float, t2_ns: int, x2: float, v2: float
) -> tuple[int, float]:
    """Instant and velocity of the pass through x = 0 between two samples.

    Cubic Hermite interpolation of both samples; Newton's method from the secant, kept between them.
    """
    h = (t2_ns - t1_ns) * 1e-9
    d = (x2 - x1) / h
    if d == 0.0:
        return t2_ns, v2
    c2 = (3.0 * d - 2.0 * v1 - v2) / h
    c3 = (v1 + v2 - 2.0 * d) / (h * h)
    s = min(max(-x1 / d, 0.0), h)
    for _ in range(3):
        slope = v1 + s * (2.0 * c2 + 3.0 * c3 * s)
        if slope == 0.0:
            break
        s = min(max(s - (x1 + s * (v1 + s * (c2 + c3 * s))) / slope, 0.0), h)
    return t1_ns + round(s * 1e9), v1 + s * (2.0 * c2 + 3.0 * c3 * s)


def seconds_to_dead_centre(motion: Motion, h: float, omega: float) -> float:
    """Predict how long it is from the newest sample to the next dead centre [s].

    Of a free oscillation v(s) = v cos(omega s) + (a / omega) sin(omega s), which ends at
    tan(omega s) = -v omega / a; a is the last difference carried to the sample by the jerk
    -omega^2 v. Exact for the phase-locked engine; in others the error shrinks with s^3.

    Parameters: h : tick [s]; omega : angular frequency of this stroke [rad/s]
    """
    speed = motion.direction * motion.v_m_s
    a = motion.direction * motion.a_m_s2 - 0.5 * h * omega * omega * speed
    return math.atan2(speed * omega, -a) / omega
