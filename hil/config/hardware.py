"""Configuration of real hardware: its sensors, its TTL lines."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.wire.messages import CHANNELS

LineOffset = Annotated[int, Field(ge=0, le=1023)]


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


class OutputsConfig(Section):
    """Which line of a GPIO chip each channel drives; without a chip nothing is driven.

    phase_us: time by which the plant's clock is taken to run ahead of the arrival of its samples
    late_us: an opening that comes to be placed only so much after its instant is left out
    silence_s: a shorter time without an answer than the plant's after which all lines go low
    spin_s: time before an edge that is not slept
    """

    chip: str | None = Field(default=None, pattern=r"^/dev/[A-Za-z0-9_.-]+$")
    lines: dict[str, LineOffset] = Field(default_factory=dict)
    active_low: bool = False
    phase_us: int = Field(default=0, ge=-1000, le=1000)
    late_us: int = Field(default=300, ge=0, le=10_000)
    silence_s: float | None = Field(default=None, ge=1e-3, le=1.0)
    spin_s: float = Field(default=100e-6, ge=0.0, le=1e-3)
    priority: int = Field(default=40, ge=0, le=98)

    @model_validator(mode="after")
    def _lines_are_whole(self) -> OutputsConfig:
        if (self.chip is None) != (not self.lines):
            raise ValueError("chip and lines are given together or not at all")
        for name in self.lines:
            if name not in CHANNELS.values():
                accepted = ", ".join(CHANNELS.values())
                raise ValueError(f"lines: {name} is no channel; accepted: {accepted}")
        if len(set(self.lines.values())) < len(self.lines):
            raise ValueError("lines: two channels on one line")
        return self
