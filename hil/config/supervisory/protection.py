"""What the engine is protected from: limits, and how load, fuel and spark are taken back."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hil.config.base import Tunable
from hil.config.ranges import PressurePa, TemperatureK

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class ProtectionConfig(Tunable):
    """Limits of pressure, knock, speed and temperature; none is watched that is not given.

    From `derate_at` of a limit on something is taken back: load for pressure and temperature, fuel
    for speed, the spark's advance for knock, and load where the spark has no position of its own.
    Beyond the limit for `patience` strokes in a row the engine goes to its safe state.

    peak_pa: pressure of a cycle; knock_w_m2: ringing intensity of its rise, petrol knocks from
        some 5 MW/m2 on; speed_hz: engine speed; winding_k: temperature of the winding
    fired_ratio: a charge has burnt whose peak is so many times that of its compression; not judged
        unless given. `limits.misfires` cycles of a side in a row that have not, and whose motion
        does not tell otherwise, are too many
    gain: share taken back a stroke for each share beyond; most: the most that is taken back
    retard_m: how much nearer to the head the spark is then
    """

    peak_pa: PressurePa | None = Field(default=None)
    knock_w_m2: float | None = Field(default=None, gt=0.0, le=1.0e12)
    speed_hz: float | None = Field(default=None, gt=0.0, le=1000.0)
    winding_k: TemperatureK | None = None
    fired_ratio: float | None = Field(default=None, gt=1.0, le=10.0)
    derate_at: float = Field(default=0.9, gt=0.0, le=1.0)
    patience: int = Field(default=2, ge=1, le=1000)
    gain: Share = 0.1
    most: Share = 0.4
    retard_m: float = Field(default=1.5e-3, ge=0.0, le=0.05)

    @property
    def needs_pressure(self) -> bool:
        """Whether something is judged by the cycles' pressure."""
        return not (self.peak_pa is None and self.knock_w_m2 is None and self.fired_ratio is None)
