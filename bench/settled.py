"""Peak and settling of a series of TDC errors, also where combustion noise never lets it rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

BAND_M = 0.1e-3
"""A dead centre this close to its set point has settled."""
BAND_MM = BAND_M * 1e3
MEAN_OF = 10
"""Strokes whose mean has to lie in the band, where single strokes scatter."""

SIGMAS = 3.0


class Response(NamedTuple):
    """TDC errors [mm] after an event with their times [s], and what is read off them.

    sigma_mm: scatter of the strokes before the event
    """

    times_s: tuple[float, ...]
    errors_mm: tuple[float, ...]
    sigma_mm: float = 0.0

    @property
    def peak_mm(self) -> float:
        """Largest error; nan without a stroke."""
        return max((abs(error) for error in self.errors_mm), default=math.nan)

    @property
    def settling_ms(self) -> float:
        """To the first dead centre after the last one outside +-0.1 mm; inf when never."""
        return _after_last(self.times_s, self.errors_mm, BAND_MM)

    @property
    def settling_band_ms(self) -> float:
        """The same with the band max(0.1 mm, 3 sigma)."""
        return _after_last(self.times_s, self.errors_mm, max(BAND_MM, SIGMAS * self.sigma_mm))

    @property
    def settling_mean_ms(self) -> float:
        """To the first of the first ten strokes in a row whose mean lies inside +-0.1 mm."""
        for i in range(len(self.errors_mm) - MEAN_OF + 1):
            if abs(sum(self.errors_mm[i : i + MEAN_OF])) <= MEAN_OF * BAND_MM:
                return 1e3 * self.times_s[i]
        return math.inf


def _after_last(times_s: Sequence[float], errors_mm: Sequence[float], band_mm: float) -> float:
    outside = [i for i, error in enumerate(errors_mm) if abs(error) > band_mm]
    first = outside[-1] + 1 if outside else 0
    return 1e3 * times_s[first] if first < len(errors_mm) else math.inf
