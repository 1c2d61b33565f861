"""Configuration of analogue sensors of real hardware."""

from __future__ import annotations

from pydantic import Field, model_validator

from hil.config.base import Section


class SensorConfig(Section):
    """One channel of the device, and what its voltage means: y = gain u + offset.

    low_v, high_v: a voltage beyond these is no measurement (a broken wire)
    """

    channel: int = Field(ge=0, le=255)
    gain: float
    offset: float = 0.0
    low_v: float = Field(default=0.0, ge=-50.0, le=50.0)
    high_v: float = Field(default=5.0, ge=-50.0, le=50.0)

    @model_validator(mode="after")
    def _range_is_one(self) -> SensorConfig:
        if self.low_v >= self.high_v:
            raise ValueError(f"low_v = {self.low_v:g}: accepted is less than high_v")
        return self


class InputsConfig(Section):
    """Which channels of an analogue device measure what; without a device nothing is read."""

    device: str | None = Field(default=None, pattern=r"^[A-Za-z0-9:_-]+$")
    x_m: SensorConfig | None = None
    v_m_s: SensorConfig | None = None
    electric_power_w: SensorConfig | None = None
    p_left_pa: SensorConfig | None = None
    p_right_pa: SensorConfig | None = None

    @model_validator(mode="after")
    def _sensors_are_whole(self) -> InputsConfig:
        needed = (self.x_m, self.v_m_s, self.electric_power_w)
        more = (self.p_left_pa, self.p_right_pa)
        if self.device is None and any(needed + more):
            raise ValueError("sensors belong to a device")
        if self.device is not None and None in needed:
            raise ValueError("a device needs x_m, v_m_s and electric_power_w")
        if (self.p_left_pa is None) != (self.p_right_pa is None):
            raise ValueError("p_left_pa and p_right_pa are given together or not at all")
        return self
