"""What the laws without a stroke's map learn of two cylinders that differ.

Unequal charges end the strokes to one side too far and those to the other too short, over and over.
Half of that alternation, as fuel by the slope of the steady state, moves the share of the sides:

y = (e_left - e_right) / 2,   d += gain y (dm/dX) / m,   m_right = (1 + d) m,   m_left = (1 - d) m

What follows a load step or comes from noise changes its sign from stroke to stroke. So of the last
few y the least counts, and only while all have the same sign: a load step teaches nothing.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.knowledge import OperatingPoint
from controller.motion.law import View
from hil.config.motion.laws import LearningConfig
from hil.values import Value

_CALM_M: Final = 20e-6
"""Alternation that is left alone: the resolution of a dead centre between two samples."""

_OTHERS: Final = 5
"""So many strokes before the last one must show the same."""


@final
class Balance(Value):
    """Share d by which the right cylinder gets more; last error [m], and the last few y [m]."""

    __slots__ = ("more", "e_m", "seen_m")

    def __init__(self, more: float = 0.0, e_m: float = 0.0, seen_m: tuple[float, ...] = ()) -> None:
        self.more = more
        self.e_m = e_m
        self.seen_m = seen_m

    def shared(self, fuel_kg: float, side: i64) -> float:
        """The part of that side of a fuel for both [kg]."""
        return fuel_kg * (1.0 + self.more if side == 1 else 1.0 - self.more)

    def forgetting(self) -> Balance:
        """What was learnt, without the strokes before."""
        return Balance(self.more)


EVEN: Final = Balance()


def learnt(config: LearningConfig, balance: Balance, view: View, e_m: float) -> Balance:
    """The balance after a dead centre that was short of its set point by e_m."""
    y_m = 0.5 * (balance.e_m - e_m if view.motion.side == 1 else e_m - balance.e_m)
    seen_m = (*balance.seen_m[-_OTHERS:], y_m)
    more = balance.more
    if len(seen_m) > _OTHERS:
        more += config.gain * _lasting(seen_m) * _share_per_m(view.point, view.tdc_ref_m)
    return Balance(_within(config, more), e_m, seen_m)


def of_burnt(config: LearningConfig, view: View) -> Balance:
    """The balance with which the sides are asked for the fuels that they have got."""
    left, right = view.burnt_kg
    both = left + right
    return Balance(_within(config, (right - left) / both)) if both > 0.0 else EVEN


def _lasting(seen_m: tuple[float, ...]) -> float:
    """What all have in common beyond `_CALM_M`: the least of those of one sign, else nought."""
    return max(min(seen_m) - _CALM_M, 0.0) + min(max(seen_m) + _CALM_M, 0.0)


def _share_per_m(point: OperatingPoint, tdc_ref_m: float) -> float:
    """Share of the fuel that a metre of TDC is worth, by the slope of the steady state [1/m]."""
    per_m = point.fuel_per_speed_kg_s_m * point.v_mid_m_s / tdc_ref_m
    return per_m / point.fuel_kg if point.fuel_kg > 0.0 else 0.0


def _within(config: LearningConfig, more: float) -> float:
    """Neither cylinder may be believed to get less, or more, than the shares that are learnt."""
    most = min(1.0 - config.share_min, config.share_max - 1.0)
    return min(max(more, -most), most)
