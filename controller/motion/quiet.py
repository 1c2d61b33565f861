"""Whether the errors of the dead centres are combustion noise: then a law is to leave them alone.

Each combustion errs by itself. What a law does against an error that is over adds to the next one;
the least scatter is left by the fuel that is right on average. So the scatter of the errors is
followed, and while they are no more than it explains the gains are a share of what they were. An
error that is too large for it, or a mean of one side's errors that is (Roberts's control chart,
1959), is a change and brings all of the gains back for some strokes.

sigma, their scatter about the mean of a side, moves by a small share towards where as many errors
are beyond it as a normal distribution has there, so that the size of a load step's errors does not
show in it. Without noise all of the gains act, to the bit.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from hil.config.motion.laws import QuietConfig
from hil.values import Value

_FLOOR_M: Final = 20e-6
"""The least scatter that is believed: the resolution of a dead centre between two samples."""
_MOST_M: Final = 0.5e-3
"""And the most: errors that are larger are not left alone."""
_INSIDE: Final = 0.683
"""Share of a normal distribution within sigma."""
_PACE: Final = 0.03
_FIRST_PACE: Final = 0.1
"""Share by which the scatter moves with an error, and does until there is one to be quiet about."""


@final
class Quiet:
    """Section `quiet` of the configuration, read once for all ticks."""

    def __init__(self, config: QuietConfig) -> None:
        self.enabled = config.enabled
        self.share = config.share
        self.least_m = config.least_m
        self.gate = config.gate
        self.mean_gain = config.mean_gain
        self.mean_gate: float = config.gate * math.sqrt(config.mean_gain / (2.0 - config.mean_gain))
        self.strokes: i64 = config.strokes


@final
class Noise(Value):
    """Scatter of the errors [m], and their mean of late at the dead centres (left, right) [sigma].

    alert: strokes for which all of the gains are still needed
    """

    __slots__ = ("sigma_m", "mean", "alert")

    def __init__(
        self, sigma_m: float = _FLOOR_M, mean: tuple[float, float] = (0.0, 0.0), alert: i64 = 0
    ) -> None:
        self.sigma_m = sigma_m
        self.mean = mean
        self.alert = alert

    def after(self, quiet: Quiet, e_m: float, side: i64, next_m: float = 0.0) -> Noise:
        """Return what is known after an error of the dead centre at that side.

        Parameters: next_m : about the error of the next one, as the speed of its stroke shows it
        """
        if not quiet.enabled:
            return self
        e, (left, right) = e_m / self.sigma_m, self.mean
        mean = left if side == 0 else right
        pace = _FIRST_PACE if self.sigma_m < quiet.least_m else _PACE
        moved = 1.0 + pace * (_INSIDE if abs(e - mean) > 1.0 else _INSIDE - 1.0)
        sigma_m = min(max(self.sigma_m * moved, _FLOOR_M), _MOST_M)
        sudden = max(abs(e), abs(next_m) / self.sigma_m) > quiet.gate
        mean += quiet.mean_gain * (min(max(e, -quiet.gate), quiet.gate) - mean)
        means = (mean, right) if side == 0 else (left, mean)
        if sudden or abs(mean) > quiet.mean_gate:
            return Noise(sigma_m, means, quiet.strokes)
        return Noise(sigma_m, means, max(self.alert - 1, 0))

    def share(self, quiet: Quiet) -> float:
        """The part of the gains that is to act."""
        calm = quiet.enabled and self.alert == 0 and self.sigma_m >= quiet.least_m
        return quiet.share if calm else 1.0


NOTHING_SEEN: Final = Noise()
