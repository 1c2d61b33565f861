"""A target power, and what stands between the engine and it."""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from controller.supervision.performance import LOAD_MAX_N_S_M
from hil.values import Value


@final
class Target(Value):
    """A target power.

    asked_w, within_w: as it was asked for, and as far as the engine reaches
    base_n_s_m, trim: load for it as far as the engine is known, and the correction as a share
    limit, held: what keeps the engine from it, as foreseen and as it has shown
    told: what has been told of that
    power_w: power measured, averaged over some strokes, None before the first
    short: strokes in a row that all the fuel there may be did not bring to the set point
    """

    __slots__ = (
        "asked_w", "within_w", "base_n_s_m", "trim", "limit", "held", "told", "short",
        "power_w",
    )  # fmt: skip

    def __init__(
        self, asked_w: float, within_w: float, base_n_s_m: float, trim: float = 0.0,
        limit: str = "", held: str = "", told: str = "", short: i64 = 0,
        power_w: float | None = None,
    ) -> None:  # fmt: skip
        self.asked_w = asked_w
        self.within_w = within_w
        self.base_n_s_m = base_n_s_m
        self.trim = trim
        self.limit = limit
        self.held = held
        self.told = told
        self.short = short
        self.power_w = power_w

    @property
    def load_n_s_m(self) -> float:
        """The load that is to deliver it [N s/m]."""
        return min(self.base_n_s_m * (1.0 + self.trim), LOAD_MAX_N_S_M)

    @property
    def in_the_way(self) -> str:
        """What keeps the engine from it; an empty string when nothing does."""
        return self.held or self.limit
