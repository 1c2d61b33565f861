"""Whether a sample can be true: the piston moves no further in a tick than physics lets it.

CRC, counter and range let one damaged frame in some hundreds through; a sample that fits neither
the one before nor those that come after it is taken for such a frame, or for a broken sensor.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.values import Value

ACCELERATION_MAX_M_S2: Final = 6000.0
"""Air spring of the Newcastle engine at the limit of its stroke, with combustion: about 4000."""

POSITION_MARGIN_M: Final = 0.5e-3
SPEED_MARGIN_M_S: Final = 0.5
AGREE_TO_BELIEVE: Final = 5
"""So many refused samples in a row that fit each other are the truth, and the old one was not."""


@final
class Credence(Value):
    """The newest refused sample, and how many in a row have fitted each other."""

    __slots__ = ("t_ns", "x_m", "v_m_s", "agreeing")

    def __init__(
        self, t_ns: i64 = -1, x_m: float = 0.0, v_m_s: float = 0.0, agreeing: i64 = 0
    ) -> None:
        self.t_ns = t_ns
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.agreeing = agreeing


CLEAR: Final = Credence()


def fits(t1_ns: i64, x1: float, v1: float, t2_ns: i64, x2: float, v2: float) -> bool:
    """Whether one motion passes through both samples.

    |v2 - v1| <= a h and |x2 - x1 - (v1 + v2) h / 2| <= a h^2 / 4, each with a margin
    """
    h = float(t2_ns - t1_ns) * 1e-9
    dv = v2 - v1
    most = ACCELERATION_MAX_M_S2 * h
    if not -most - SPEED_MARGIN_M_S <= dv <= most + SPEED_MARGIN_M_S:
        return False
    error = x2 - x1 - 0.5 * (v1 + v2) * h
    most = 0.25 * most * h + POSITION_MARGIN_M
    return -most <= error <= most


def judge(
    credence: Credence, t1_ns: i64, x1: float, v1: float, t2_ns: i64, x2: float, v2: float
) -> tuple[Credence, bool]:
    """Judge sample 2 by the last accepted one, 1.

    Returns: what to remember, and whether the sample may be used
    """
    if t1_ns < 0 or fits(t1_ns, x1, v1, t2_ns, x2, v2):
        return CLEAR, True
    agreeing: i64 = 1
    if credence.agreeing and fits(credence.t_ns, credence.x_m, credence.v_m_s, t2_ns, x2, v2):
        agreeing = credence.agreeing + 1
    if agreeing >= AGREE_TO_BELIEVE:
        return CLEAR, True
    return Credence(t2_ns, x2, v2, agreeing), False
