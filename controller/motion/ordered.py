"""Under which set point a stroke was ordered: an error counts against that one, not a newer one.

At mid-stroke j the fuel is asked for that drives stroke j + 1. So the last dead centre ended a
stroke that was ordered two strokes ago, and the piston moves on what was ordered a stroke ago.
"""

from __future__ import annotations

from typing import final

from hil.values import Value


@final
class Ordered(Value):
    """Set points of the last order and of the one before [m]; 0 where there was none."""

    __slots__ = ("last_m", "before_m")

    def __init__(self, last_m: float = 0.0, before_m: float = 0.0) -> None:
        self.last_m = last_m
        self.before_m = before_m

    def and_now(self, tdc_ref_m: float) -> Ordered:
        """The same after another order."""
        return Ordered(tdc_ref_m, self.last_m)

    def for_dead_centre(self, tdc_ref_m: float) -> float:
        """Set point of the stroke that has ended [m]; the present one where it was not ordered."""
        return self.before_m or tdc_ref_m

    def for_mid_stroke(self, tdc_ref_m: float) -> float:
        """Set point that the speed of the stroke under way belongs to [m], likewise.

        The stroke goes from a dead centre of the order before to one of the last order, and its
        speed at the middle is in proportion to the mean of both.
        """
        if self.last_m == 0.0:
            return tdc_ref_m
        return 0.5 * (self.last_m + (self.before_m or self.last_m))
