"""Whether a sample can be true: against the one before, the integrated velocity, the engine, power.

CRC, counter and range let one damaged frame in some hundreds through, and know nothing of a sensor
that lies with live counters. A sample that is not believed is left out, the map bridges what is
missing; when that has lasted, the fault has a name and the engine goes to its safe state.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.observe.possible import Possible
from hil.values import Value

NONE: Final[i64] = 0
JUMPS: Final[i64] = 1
LEAPS: Final[i64] = 2
DISAGREES: Final[i64] = 3
STANDS: Final[i64] = 4
POWER: Final[i64] = 5
OVERDUE: Final[i64] = 6
UNBRAKED: Final[i64] = 7
PEAK: Final[i64] = 8
KNOCKS: Final[i64] = 9
OVERSPEED: Final[i64] = 10
HOT: Final[i64] = 11
PRESSURELESS: Final[i64] = 12

NAMES: Final = (
    "", "position sensor jumps", "velocity sensor jumps", "position and velocity disagree",
    "piston seems to stand still", "velocity contradicts the electric power",
    "stroke is overdue", "machine takes up no power", "peak pressure beyond its limit",
    "knock beyond its limit", "speed beyond its limit", "winding beyond its limit",
    "charges do not burn by their pressure",
)  # fmt: skip

_REFUSED: Final = "10 ms of refused samples"
_IN_A_ROW: Final = "controller.protection.patience in a row"

SIGNS: Final = (
    ("", ""),
    ("position beside the integrated velocity by more than physics allows in a tick", _REFUSED),
    ("velocity changes by more than springs, charge and machine can do, and stays so", _REFUSED),
    ("position runs away from the integrated velocity", _REFUSED),
    ("speed below 5 % of that at mid-stroke where the springs push", "a quarter of a stroke"),
    ("electric power that c v^2, or in motoring F v, cannot explain", "two readings, 4 ticks"),
    ("no dead centre", "2.5 strokes, or two of the air springs alone"),
    ("no electric power at speed in a stroke that has fired", "three readings, 6 ticks"),
    ("peak of a cycle beyond controller.protection.peak_pa", _IN_A_ROW),
    ("ringing intensity of a cycle beyond controller.protection.knock_w_m2", _IN_A_ROW),
    ("strokes shorter than controller.protection.speed_hz allows", _IN_A_ROW),
    ("temperature of the winding beyond controller.protection.winding_k", _IN_A_ROW),
    (
        "peak of a side below controller.protection.fired_ratio times its compression",
        "controller.limits.misfires cycles in a row",
    ),
)
"""What each is detected by, and how soon: rows of docs/safe-state.md."""

SPEED_MARGIN_M_S: Final = 0.25
POSITION_MARGIN: Final = 0.03
LEAST_POSITION_MARGIN: Final = 0.01
MARGIN_PER_S: Final = 30.0
"""Of the amplitude: what a sample may lie beside the integrated velocity, at 1 kHz and faster."""

DRIFT_MARGIN: Final = 0.05
FORGETTING_S: Final = 0.010
"""Of the amplitude, and the time in which what was integrated too much is forgotten."""

ADJACENT: Final = 2.5
"""Samples so many periods apart follow each other."""

COARSE_S: Final = 2.5e-3
"""In a longer tick the acceleration changes too much for all but the widest bounds."""

AGREE_TO_BELIEVE: Final[i64] = 5
"""Refused samples that fit each other are the truth where nothing hangs on it, engine off."""


@final
class Witness(Value):
    """What is remembered of samples, believed or not.

    t_ns, x_m, v_m_s: the newest one; believed_x_m: position by its velocity from the last believed
    leap_m_s: by how much the velocity has leapt and not come back; without it, it is integrated
    drift_m: what believed positions ran beside the velocity; agreeing: refused ones in a row
    refused_ns: for how long, what was believed since counted half; doubt: why
    slow_ns: since when the piston has been slow, -1 it is not; power: readings in a row that
        contradict the velocity, negative ones of a machine that takes up no power
    """

    __slots__ = (
        "t_ns", "x_m", "v_m_s", "believed_x_m", "drift_m", "agreeing", "refused_ns", "doubt",
        "slow_ns", "power", "leap_m_s",
    )  # fmt: skip

    def __init__(
        self, t_ns: i64 = -1, x_m: float = 0.0, v_m_s: float = 0.0, believed_x_m: float = 0.0,
        drift_m: float = 0.0, agreeing: i64 = 0, refused_ns: i64 = 0, doubt: i64 = 0,
        slow_ns: i64 = -1, power: i64 = 0, leap_m_s: float = 0.0,
    ) -> None:  # fmt: skip
        self.t_ns = t_ns
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.believed_x_m = believed_x_m
        self.drift_m = drift_m
        self.agreeing = agreeing
        self.refused_ns = refused_ns
        self.doubt = doubt
        self.slow_ns = slow_ns
        self.power = power
        self.leap_m_s = leap_m_s


UNHEARD_OF: Final = Witness()


def fault_of(possible: Possible, witness: Witness) -> i64:
    """The fault that has lasted; NONE while there is none, or it can be bridged."""
    return witness.doubt if witness.refused_ns >= possible.patience_ns else NONE


def judge(
    possible: Possible, w: Witness, motion: Motion, t_ns: i64, x: float, v: float, active: bool
) -> Witness:
    """Judge a sample; it may be used when the witness has `agreeing` nought.

    Parameters: motion : as of the last sample that was believed; active : the engine is running
    """
    if w.t_ns < 0 or motion.t_ns < 0:
        return Witness(t_ns, x, v, x)
    h = float(t_ns - w.t_ns) * 1e-9
    if w.agreeing == 0 and h > ADJACENT * float(possible.period_ns) * 1e-9:
        return _after_gap(possible, w, t_ns, x, v, h)
    most_m_s = _leap_most(possible, w.x_m, x, h)
    leap_m_s = w.leap_m_s
    if abs(v - w.v_m_s) > most_m_s:
        leap_m_s += v - w.v_m_s
    expected_x = w.believed_x_m + 0.5 * (w.v_m_s - w.leap_m_s + v - leap_m_s) * h
    beside = x - expected_x
    drift = w.drift_m * max(1.0 - h / FORGETTING_S, 0.0) + beside
    doubt = NONE
    if abs(leap_m_s) > most_m_s:
        doubt = LEAPS
    elif abs(beside) > _beside_most(possible, w.x_m, x, h):
        doubt = JUMPS
    elif abs(drift) > _drift_most(possible, h):
        doubt = DISAGREES
    if doubt == NONE:
        return _believed(w, t_ns, x, v, drift, h)
    return _refused(w, t_ns, x, v, expected_x, leap_m_s, doubt, h, active)


def _believed(w: Witness, t_ns: i64, x: float, v: float, drift: float, h: float) -> Witness:
    """The witness after a sample that fits; doubts are forgotten at half the pace."""
    if w.refused_ns == 0:
        return Witness(t_ns, x, v, x, drift, 0, 0, NONE, w.slow_ns, w.power)
    left = max(w.refused_ns - i64(h * 0.5e9), 0)
    doubt = w.doubt if left > 0 else NONE
    return Witness(t_ns, x, v, x, drift, 0, left, doubt, w.slow_ns, w.power)


def _refused(
    w: Witness, t_ns: i64, x: float, v: float, expected_x: float, leap_m_s: float, doubt: i64,
    h: float, active: bool,
) -> Witness:  # fmt: skip
    """The witness after a sample that does not fit; where the engine is off it may be the truth."""
    agreeing = w.agreeing + 1
    if not active and agreeing >= AGREE_TO_BELIEVE:
        return Witness(t_ns, x, v, x)
    first = w.doubt if w.doubt != NONE else doubt
    drift = w.drift_m * max(1.0 - h / FORGETTING_S, 0.0)
    refused_ns = w.refused_ns + i64(h * 1e9)
    return Witness(
        t_ns, x, v, expected_x, drift, agreeing, refused_ns, first, w.slow_ns, w.power, leap_m_s
    )


def _after_gap(possible: Possible, w: Witness, t_ns: i64, x: float, v: float, h: float) -> Witness:
    """Where samples were missing the widest bounds hold: a stroke may have ended in between."""
    most = possible.acceleration(possible.reach_m, x) * h
    beside = x - w.x_m - 0.5 * (w.v_m_s + v) * h
    if abs(v - w.v_m_s) > most + SPEED_MARGIN_M_S:
        return Witness(t_ns, x, v, w.believed_x_m, 0.0, 1, 0, LEAPS, leap_m_s=v - w.v_m_s)
    if abs(beside) > 0.25 * most * h + POSITION_MARGIN * possible.reach_m:
        return Witness(t_ns, x, v, w.believed_x_m, 0.0, 1, 0, JUMPS)
    return Witness(t_ns, x, v, x)


def _leap_most(possible: Possible, x1: float, x2: float, h: float) -> float:
    """By how much the velocity may change [m/s]."""
    return (
        possible.acceleration(x1 if h <= COARSE_S else possible.reach_m, x2) * h + SPEED_MARGIN_M_S
    )


def _beside_most(possible: Possible, x1: float, x2: float, h: float) -> float:
    """How far a position may lie beside the integrated velocity: a h^2 / 8 and a margin [m]."""
    a = possible.acceleration(x1 if h <= COARSE_S else possible.reach_m, x2)
    margin = min(max(MARGIN_PER_S * h, LEAST_POSITION_MARGIN), POSITION_MARGIN)
    return margin * possible.reach_m + 0.125 * a * h * h


def _drift_most(possible: Possible, h: float) -> float:
    """How far positions may run beside the velocity within FORGETTING_S [m]."""
    if h > COARSE_S:
        return possible.reach_m
    return DRIFT_MARGIN * possible.reach_m + 1.2 * possible.a_m_s2 * h * h
