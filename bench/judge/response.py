"""The stroke's response to a disturbance: peak and settling, measured here and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from bench.judge.strokes import Strokes

BAND_MM = 0.1
"""Half the width of the band about the set point in which the engine is settled (thesis 6.3)."""

MEAN_OF = 10
"""Strokes whose mean has to lie in the band, where single strokes scatter."""

SIGMAS = 3.0


def first_settled(errors_mm: Sequence[float], band_mm: float = BAND_MM) -> int | None:
    """Index of the first dead centre after the last one outside the band.

    None when the last one lies outside, or there is none at all.
    """
    count = len(errors_mm)
    outside = (i for i in range(count - 1, -1, -1) if abs(errors_mm[i]) > band_mm)
    first = next(outside, -1) + 1
    return first if first < count else None


class Response(NamedTuple):
    """TDC errors [mm] after an event with their times [s], and what is read off them.

    sigma_mm: scatter of the strokes before the event
    fuel_kg: fuel_kg[j] burns at the dead centre of times_s[j]; empty where nobody asked
    """

    times_s: tuple[float, ...]
    errors_mm: tuple[float, ...]
    sigma_mm: float = 0.0
    fuel_kg: tuple[float, ...] = ()

    @property
    def peak_mm(self) -> float:
        """Largest error; nan without a stroke."""
        return max((abs(error) for error in self.errors_mm), default=math.nan)

    def peak_after_mm(self, after_s: float) -> float:
        """Largest error later than that; nan without a stroke there."""
        pairs = zip(self.times_s, self.errors_mm, strict=True)
        return max((abs(error) for t, error in pairs if t > after_s), default=math.nan)

    def settling_s(self, band_mm: float = BAND_MM) -> float:
        """To the first dead centre after the last one outside the band; inf when never."""
        first = first_settled(self.errors_mm, band_mm)
        return math.inf if first is None else self.times_s[first]

    @property
    def settling_ms(self) -> float:
        """The same for +-0.1 mm [ms]."""
        return 1e3 * self.settling_s()

    @property
    def settling_band_ms(self) -> float:
        """The same with the band max(0.1 mm, 3 sigma)."""
        return 1e3 * self.settling_s(max(BAND_MM, SIGMAS * self.sigma_mm))

    @property
    def settling_mean_ms(self) -> float:
        """To the first of the first ten strokes in a row whose mean lies inside +-0.1 mm."""
        for i in range(len(self.errors_mm) - MEAN_OF + 1):
            if abs(sum(self.errors_mm[i : i + MEAN_OF])) <= MEAN_OF * BAND_MM:
                return 1e3 * self.times_s[i]
        return math.inf


def response(strokes: Strokes, event_ns: int) -> Response:
    """Return the response of a run's strokes to what happened at an instant."""
    after = strokes.since(event_ns)
    times_s = tuple((int(t_ns) - event_ns) * 1e-9 for t_ns in after.t_ns)
    return Response(times_s, tuple((after.error_m * 1e3).tolist()))


def settled_after_s(found: Response, band_mm: float = BAND_MM) -> float | None:
    """Time from the event until settled: nought when the band was never left, None when never."""
    first = first_settled(found.errors_mm, band_mm)
    if first is None:
        return None
    return found.times_s[first] if first else 0.0
