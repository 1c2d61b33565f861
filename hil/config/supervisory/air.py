"""What the controller believes of the air path."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hil.config.base import Section
from hil.config.ranges import PressurePa, TemperatureK


class AirKnowledge(Section):
    """The controller's own estimate of the air that a charge has, from throttle and lag.

    limit: whether the fuel is limited by it, and no longer by a share of `limits.fuel_max_kg`; as
        the plant's unless given
    manifold_pa, temperature_k, lag_s: as the plant's unless given
    lambda_least: so lean at the least the fuel is kept
    lambda_ref: lambda that the throttle is set for; without it the throttle stays as it is
    """

    limit: bool = False
    manifold_pa: PressurePa | None = None
    temperature_k: TemperatureK | None = None
    lag_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.05
    lambda_least: Annotated[float, Field(gt=0.5, le=3.0)] = 1.0
    lambda_ref: Annotated[float, Field(gt=0.5, le=3.0)] | None = None
