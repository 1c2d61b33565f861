"""What the plant measures beside motion, power and pressures: off unless it is asked for."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hil.config.base import Section
from hil.config.ranges import TemperatureK


class IndicatorConfig(Section):
    """Peak, its position and steepest rise of each cylinder's pressure, told once a stroke.

    interval_s: time between two readings of the pressure, over which a rise is told; engines in
        full are read at every step of their integration
    """

    on: bool = False
    interval_s: Annotated[float, Field(ge=1.0e-6, le=1.0e-2)] = 1.0e-4


class WindingConfig(Section):
    """Temperature of the machine's winding: C dT/dt = (F / K)^2 - G (T - T_ambient).

    All assumed, of a machine in which a tenth of the power is heat; that of App. I, with
    74.4 N/A and 14 ohm, has K = 19.9.

    force_n_sqrt_w: K, force by the root of the heat that its current is worth
    heat_capacity_j_k: C, of copper and iron that warm up together; cooling_w_k: G
    begin_k: temperature at the start of a run, the surroundings' unless given
    """

    on: bool = False
    force_n_sqrt_w: Annotated[float, Field(gt=0.0, le=1.0e4)] = 80.0
    heat_capacity_j_k: Annotated[float, Field(gt=0.0, le=1.0e6)] = 2000.0
    cooling_w_k: Annotated[float, Field(gt=0.0, le=1.0e4)] = 10.0
    ambient_k: TemperatureK = 298.15
    begin_k: TemperatureK | None = None
