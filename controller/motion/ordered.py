"""Under which set point a stroke was ordered: an error counts against that one, not a newer one.

At mid-stroke j the fuel is asked for that drives stroke j + 1. So the last dead centre ended a
stroke that was ordered two strokes ago, and the piston moves on what was ordered a stroke ago. With
a lag, of a port injection, all of that is a stroke longer ago.
"""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from hil.values import Value


@final
class Ordered(Value):
    """Set points of the last three orders, the newest first [m]; 0 where there was none."""

    __slots__ = ("last_m", "before_m", "first_m")

    def __init__(self, last_m: float = 0.0, before_m: float = 0.0, first_m: float = 0.0) -> None:
        self.last_m = last_m
        self.before_m = before_m
        self.first_m = first_m

    def and_now(self, tdc_ref_m: float) -> Ordered:
        """The same after another order."""
        return Ordered(tdc_ref_m, self.last_m, self.before_m)

    def for_dead_centre(self, tdc_ref_m: float, lag: i64 = 0) -> float:
        """Set point of the stroke that has ended [m]; the present one where it was not ordered."""
        return (self.first_m if lag else self.before_m) or tdc_ref_m

    def for_mid_stroke(self, tdc_ref_m: float, lag: i64 = 0) -> float:
        """Set point that the speed of the stroke under way belongs to [m], likewise.

        The stroke goes from a dead centre of the order before to one of the last order, and its
        speed at the middle is in proportion to the mean of both.
        """
        last_m, before_m = self.last_m, self.before_m
        if lag:
            last_m, before_m = self.before_m, self.first_m
        if last_m == 0.0:
            return tdc_ref_m
        return 0.5 * (last_m + (before_m or last_m))
