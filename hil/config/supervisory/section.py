"""The supervisory layer's section of the configuration."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from hil.config.base import Tunable, ranged
from hil.config.ranges import CommandedLoad
from hil.config.supervisory.performance import PerformanceMap
from hil.wire.commands import TARGET_POWER_W

TargetPowerW = Annotated[float, ranged(TARGET_POWER_W)]


class SupervisoryConfig(Tunable):
    """Set points from a target power (level 2); without a target the fixed values hold.

    tdc_step_m: most by which the TDC set point moves in a stroke
    tdc_room_m: what an operator's set point must leave to the position limit, for the scatter of
        the strokes
    load_slew_n_s_m_per_s: how fast the load may change
    power_gain: share of the error of the measured power that one stroke's correction takes away
    trim_most: largest correction of the load, as a share of what map or closed form ask for
    fuel_reserve: share of the most fuel that a target power leaves to the control of the dead
        centres
    choice: `efficiency` lets a target power choose dead centre and throttle, too, by the map
    """

    target_power_w: TargetPowerW | None = None
    load_coefficient_n_s_m: CommandedLoad | None = None
    load_slew_n_s_m_per_s: float = Field(default=2000.0, gt=0.0, le=1e6)
    tdc_step_m: float = Field(default=1.0e-3, gt=0.0, le=0.05)
    tdc_room_m: float = Field(default=0.3e-3, ge=0.0, le=0.01)
    throttle: float = Field(default=1.0, gt=0.0, le=1.0)
    power_gain: float = Field(default=0.05, ge=0.0, le=1.0)
    trim_most: float = Field(default=0.5, ge=0.0, le=0.9)
    fuel_reserve: float = Field(default=0.1, ge=0.0, le=0.9)
    choice: Literal["fixed", "efficiency"] = "fixed"
    map: PerformanceMap | None = None

    @model_validator(mode="after")
    def _choice_has_a_map(self) -> Self:
        if self.choice == "efficiency" and self.map is None:
            raise ValueError("choice = 'efficiency' needs a map; `hil map` makes one")
        return self
