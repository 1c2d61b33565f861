"""From samples to strokes: dead centres and mid-stroke speeds between the ticks.

A sample gives position and velocity at a tick; what the layers need happens between two.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from hil.roots import newton
from hil.rounding import nearest
from hil.values import Value
from hil.wire.messages import PistonSample

AMPLITUDE_MIN_M: Final = 0.5e-3
"""A reversal nearer to mid-stroke than this is no dead centre that could be fired."""

SPEED_MIN_M_S: Final = 5e-3
"""Below this the direction of motion is not judged."""

SHOWN_NS: Final = 3_000_000
"""What lies between two samples further apart than this has not been seen when some are missing."""


@final
class Motion(Value):
    """What is known of the motion.

    direction: +1 to the right head, -1 to the left, 0 not moving yet
    t_ns, x_m, v_m_s: newest sample; a_m_s2: acceleration between the last two
    tdc_m, side, dc_t_ns: last dead centre as distance, its head (0 left, 1 right), its instant
    v_mid_m_s, mid_t_ns: last pass through the middle
    stroke: number of the stroke; passed_mid: whether this stroke has passed the middle
    quarter_ns: from there to the dead centre, in the last stroke that had both
    """

    __slots__ = (
        "direction", "t_ns", "x_m", "v_m_s", "a_m_s2", "tdc_m", "side", "dc_t_ns", "v_mid_m_s",
        "mid_t_ns", "stroke", "passed_mid", "quarter_ns",
    )  # fmt: skip

    def __init__(
        self, direction: i64 = 0, t_ns: i64 = -1, x_m: float = 0.0, v_m_s: float = 0.0,
        a_m_s2: float = 0.0, tdc_m: float = 0.0, side: i64 = 0, dc_t_ns: i64 = -1,
        v_mid_m_s: float = 0.0, mid_t_ns: i64 = -1, stroke: i64 = 0, passed_mid: bool = False,
        quarter_ns: i64 = 0,
    ) -> None:  # fmt: skip
        self.direction = direction
        self.t_ns = t_ns
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.a_m_s2 = a_m_s2
        self.tdc_m = tdc_m
        self.side = side
        self.dc_t_ns = dc_t_ns
        self.v_mid_m_s = v_mid_m_s
        self.mid_t_ns = mid_t_ns
        self.stroke = stroke
        self.passed_mid = passed_mid
        self.quarter_ns = quarter_ns

    def ended_at(self, tdc_m: float, dc_t_ns: i64, quarter_ns: i64) -> Motion:
        """The motion with another last dead centre, so long after mid-stroke."""
        return Motion(
            self.direction, self.t_ns, self.x_m, self.v_m_s, self.a_m_s2, tdc_m, self.side, dc_t_ns,
            self.v_mid_m_s, self.mid_t_ns, self.stroke, self.passed_mid, quarter_ns,
        )  # fmt: skip

    @property
    def z_m(self) -> float:
        """Position in the direction of motion, from the middle [m]."""
        return float(self.direction) * self.x_m

    @property
    def speed_m_s(self) -> float:
        """Velocity in the direction of motion [m/s]."""
        return float(self.direction) * self.v_m_s

    @property
    def tau_s(self) -> float:
        """Time from the last dead centre to the newest sample [s]."""
        return float(self.t_ns - self.dc_t_ns) * 1e-9

    @property
    def side_ahead(self) -> i64:
        """Head that the piston moves to: 0 left, 1 right."""
        return 1 if self.direction > 0 else 0


@final
class Passed(Value):
    """What lies between the last two samples."""

    __slots__ = ("dead_centre", "mid_stroke")

    def __init__(self, dead_centre: bool = False, mid_stroke: bool = False) -> None:
        self.dead_centre = dead_centre
        self.mid_stroke = mid_stroke


NOTHING: Final = Passed()
DEAD_CENTRE: Final = Passed(dead_centre=True)
MID_STROKE: Final = Passed(mid_stroke=True)
BOTH: Final = Passed(dead_centre=True, mid_stroke=True)


@final
class Observation(Value):
    """What a tick shows of the motion; `stale` ticks in a row have had no sample.

    unheard: for how long the plant says that it has heard nothing, 15 in its safe state
    fault: what the samples show to be wrong, nought while nothing does
    whole: whether what was passed lies between two samples that are near enough to show it
    """

    __slots__ = ("t_ns", "motion", "passed", "stale", "unheard", "whole", "fault")

    def __init__(
        self, t_ns: i64, motion: Motion, passed: Passed, stale: i64, unheard: i64 = 0,
        whole: bool = True, fault: i64 = 0,
    ) -> None:  # fmt: skip
        self.t_ns = t_ns
        self.motion = motion
        self.passed = passed
        self.stale = stale
        self.unheard = unheard
        self.whole = whole
        self.fault = fault

    def with_motion(self, motion: Motion) -> Observation:
        """The same of another motion."""
        return Observation(
            self.t_ns, motion, self.passed, self.stale, self.unheard, self.whole, self.fault
        )


def observe(
    motion: Motion, stale: i64, sample: PistonSample | None, t_ns: i64, fault: i64 = 0
) -> Observation:
    """Take the sample of a tick into the estimate, or count that there was none."""
    if sample is None:
        return Observation(t_ns, motion, NOTHING, stale + 1, 0, True, fault)
    whole = stale == 0 or t_ns - motion.t_ns <= SHOWN_NS
    after, passed = update(motion, t_ns, sample.x_m, sample.v_m_s)
    if not whole and passed.dead_centre and after.z_m > 0.0 and after.speed_m_s > 0.0:
        after, passed = _beyond_mid(motion, after), BOTH
    return Observation(t_ns, after, passed, 0, sample.unheard, whole, fault)


def _beyond_mid(before: Motion, after: Motion) -> Motion:
    """A gap has hidden a dead centre and the middle behind it; that was x / v ago, about.

    A piston that stands still again has an x / v without end: the middle lies in the gap.
    """
    gap_s = float(after.t_ns - before.t_ns) * 1e-9
    mid_t_ns = after.t_ns - nearest(min(after.z_m / after.speed_m_s, gap_s) * 1e9)
    return Motion(
        after.direction, after.t_ns, after.x_m, after.v_m_s, after.a_m_s2, after.tdc_m, after.side,
        after.dc_t_ns, before.v_mid_m_s, mid_t_ns, after.stroke, True, before.quarter_ns,
    )  # fmt: skip


def update(motion: Motion, t_ns: i64, x: float, v: float) -> tuple[Motion, Passed]:
    """Take one sample.

    Parameters: t_ns : time of the sample; x, v : position [m], velocity [m/s]
    Returns: the motion and what was passed since the last sample
    """
    if motion.direction == 0 or motion.t_ns < 0:
        return _first(motion, t_ns, x, v), NOTHING
    direction = float(motion.direction)
    a = (v - motion.v_m_s) / (float(t_ns - motion.t_ns) * 1e-9)
    if direction * v < 0.0:
        return _reversed(motion, t_ns, x, v, a)
    if not motion.passed_mid and direction * x >= 0.0:
        return _crossed(motion, t_ns, x, v, a)
    return Motion(
        motion.direction, t_ns, x, v, a, motion.tdc_m, motion.side, motion.dc_t_ns,
        motion.v_mid_m_s, motion.mid_t_ns, motion.stroke, motion.passed_mid, motion.quarter_ns,
    ), NOTHING  # fmt: skip


def _first(motion: Motion, t_ns: i64, x: float, v: float) -> Motion:
    """Without a direction: take the sample, and the direction once it can be told."""
    direction = motion.direction
    if direction == 0 and abs(v) > SPEED_MIN_M_S:
        direction = 1 if v > 0.0 else -1
    return Motion(
        direction, t_ns, x, v, motion.a_m_s2, motion.tdc_m, motion.side, motion.dc_t_ns,
        motion.v_mid_m_s, motion.mid_t_ns, motion.stroke, float(direction) * x > 0.0,
        motion.quarter_ns,
    )  # fmt: skip


def _reversed(motion: Motion, t_ns: i64, x: float, v: float, a: float) -> tuple[Motion, Passed]:
    """The velocity has changed its sign: a dead centre, if it is one worth the name."""
    dc_t_ns, dc_x = dead_centre_between(motion.t_ns, motion.x_m, motion.v_m_s, t_ns, x, v)
    direction = -motion.direction
    if float(motion.direction) * dc_x < AMPLITUDE_MIN_M:
        return Motion(
            direction, t_ns, x, v, a, motion.tdc_m, motion.side, motion.dc_t_ns,
            motion.v_mid_m_s, motion.mid_t_ns, motion.stroke, float(direction) * x > 0.0,
            motion.quarter_ns,
        ), NOTHING  # fmt: skip
    quarter_ns: i64 = dc_t_ns - motion.mid_t_ns if motion.passed_mid else 0
    return Motion(
        direction, t_ns, x, v, a, abs(dc_x), 1 if dc_x > 0.0 else 0, dc_t_ns, motion.v_mid_m_s,
        motion.mid_t_ns, motion.stroke + 1, False, quarter_ns,
    ), DEAD_CENTRE  # fmt: skip


def _crossed(motion: Motion, t_ns: i64, x: float, v: float, a: float) -> tuple[Motion, Passed]:
    """The piston has passed the middle of its stroke."""
    mid_t_ns, v_mid = crossing_between(motion.t_ns, motion.x_m, motion.v_m_s, t_ns, x, v)
    return Motion(
        motion.direction, t_ns, x, v, a, motion.tdc_m, motion.side, motion.dc_t_ns, abs(v_mid),
        mid_t_ns, motion.stroke, True, motion.quarter_ns,
    ), MID_STROKE  # fmt: skip


def dead_centre_between(
    t1_ns: i64, x1: float, v1: float, t2_ns: i64, x2: float, v2: float
) -> tuple[i64, float]:
    """Instant and position of the dead centre between two samples of opposite velocity.

    With a constant acceleration on each side, which may differ (combustion changes it at the dead
    centre itself), x_dc = x1 + v1 s / 2 = x2 - v2 (h - s) / 2, which is linear in s. The error is
    j s^3 / 12, under 4 um for a tick of 1 ms in the worst excitation, and noise is not amplified.
    """
    h = float(t2_ns - t1_ns) * 1e-9
    s = 2.0 * (x2 - x1 - 0.5 * v2 * h) / (v1 - v2)
    s = min(max(s, 0.0), h)
    return t1_ns + nearest(s * 1e9), x1 + 0.5 * v1 * s


def smooth_dead_centre_between(
    t1_ns: i64, x1: float, v1: float, t2_ns: i64, x2: float, v2: float
) -> tuple[i64, float]:
    """Likewise, where nothing happens at the dead centre itself: by the cubic of both samples.

    x = x1 + v1 s + c2 s^2 + c3 s^3 where v1 + 2 c2 s + 3 c3 s^2 = 0, the root in the tick. On the
    two-stroke engine at 1 kHz within 1 um and 6 us, where the constant accelerations miss by 3 um
    and 80 us.
    """
    h = float(t2_ns - t1_ns) * 1e-9
    d = (x2 - x1) / h
    c2 = (3.0 * d - 2.0 * v1 - v2) / h
    c3 = (v1 + v2 - 2.0 * d) / (h * h)
    # Of both roots the one at which the speed falls through nought.
    below = math.copysign(math.sqrt(max(c2 * c2 - 3.0 * c3 * v1, 0.0)), v1) - c2
    s = min(max(v1 / below, 0.0), h) if below != 0.0 else 0.0
    return t1_ns + nearest(s * 1e9), x1 + s * (v1 + s * (c2 + c3 * s))


def crossing_between(
    t1_ns: i64, x1: float, v1: float, t2_ns: i64, x2: float, v2: float
) -> tuple[i64, float]:
    """Instant and velocity of the pass through x = 0 between two samples.

    Cubic Hermite interpolation of both samples; Newton's method from the secant, kept between them.
    """
    h = float(t2_ns - t1_ns) * 1e-9
    d = (x2 - x1) / h
    if d == 0.0:
        return t2_ns, v2
    c2 = (3.0 * d - 2.0 * v1 - v2) / h
    c3 = (v1 + v2 - 2.0 * d) / (h * h)

    def height(s: float) -> tuple[float, float]:
        return x1 + s * (v1 + s * (c2 + c3 * s)), v1 + s * (2.0 * c2 + 3.0 * c3 * s)

    s = newton(height, min(max(-x1 / d, 0.0), h), low=0.0, high=h, steps=3)
    return t1_ns + nearest(s * 1e9), height(s)[1]


def seconds_to_dead_centre(motion: Motion, h: float, omega: float) -> float:
    """Predict how long it is from the newest sample to the next dead centre [s].

    Of a free oscillation v(s) = v cos(omega s) + (a / omega) sin(omega s), which ends at
    tan(omega s) = -v omega / a; a is the last difference carried to the sample by the jerk
    -omega^2 v. Exact for the phase-locked engine; in others the error shrinks with s^3.

    Parameters: h : tick [s]; omega : angular frequency of this stroke [rad/s]
    """
    speed = motion.speed_m_s
    a = float(motion.direction) * motion.a_m_s2 - 0.5 * h * omega * omega * speed
    return math.atan2(speed * omega, -a) / omega
