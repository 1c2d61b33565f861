"""Configuration of real hardware, its sensors and TTL lines; and of what a plant may measure."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.config.ranges import TemperatureK
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


class EncoderConfig(Section):
    """An incremental encoder, a Linux counter: x = count metres_per_count + offset_m."""

    device: str = Field(default="counter0", pattern=r"^[A-Za-z0-9:_-]+$")
    count: int = Field(default=0, ge=0, le=255)
    metres_per_count: float = Field(default=10.0e-6, gt=0.0, le=1.0e-3)
    offset_m: float = Field(default=0.0, ge=-1.0, le=1.0)


class VoltageConfig(Section):
    """One output channel: u = gain y + offset, from low_v to high_v; rest_v when none is asked."""

    channel: int = Field(ge=0, le=255)
    gain: float
    offset: float = 0.0
    low_v: float = Field(default=0.0, ge=-50.0, le=50.0)
    high_v: float = Field(default=5.0, ge=-50.0, le=50.0)
    rest_v: float = Field(default=0.0, ge=-50.0, le=50.0)

    @model_validator(mode="after")
    def _range_is_one(self) -> VoltageConfig:
        if not self.low_v <= self.rest_v <= self.high_v or self.low_v == self.high_v:
            raise ValueError(
                f"rest_v = {self.rest_v:g}: accepted from low_v = {self.low_v:g} to high_v = "
                f"{self.high_v:g}, which are two"
            )
        return self


class AnalogOutputsConfig(Section):
    """Which channels of an analogue device take the machine's order and the throttle's."""

    device: str | None = Field(default=None, pattern=r"^[A-Za-z0-9:_-]+$")
    force_n: VoltageConfig | None = None
    load_coefficient_n_s_m: VoltageConfig | None = None
    throttle: VoltageConfig | None = None

    @model_validator(mode="after")
    def _channels_belong(self) -> AnalogOutputsConfig:
        given = [self.force_n, self.load_coefficient_n_s_m, self.throttle]
        if (self.device is None) != (not any(given)):
            raise ValueError("device and at least one channel are given together or not at all")
        return self


class InputsConfig(Section):
    """Which channels of an analogue device measure what; without a device nothing is read.

    encoder: in place of x_m; without v_m_s the velocity is that of the positions
    resolution_m: least step of positions that are to give the velocity, where they are analogue
    """

    encoder: EncoderConfig | None = None
    resolution_m: float = Field(default=10.0e-6, gt=0.0, le=1.0e-3)
    device: str | None = Field(default=None, pattern=r"^[A-Za-z0-9:_-]+$")
    x_m: SensorConfig | None = None
    v_m_s: SensorConfig | None = None
    electric_power_w: SensorConfig | None = None
    p_left_pa: SensorConfig | None = None
    p_right_pa: SensorConfig | None = None

    @model_validator(mode="after")
    def _sensors_are_whole(self) -> InputsConfig:
        known = (self.x_m, self.v_m_s, self.electric_power_w, self.p_left_pa, self.p_right_pa)
        if self.device is None and any((*known, self.encoder)):
            raise ValueError("sensors belong to a device")
        position = (self.x_m is None) != (self.encoder is None)
        if self.device is not None and not (position and self.electric_power_w):
            raise ValueError("a device needs x_m or an encoder, and electric_power_w")
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
    analog: AnalogOutputsConfig = AnalogOutputsConfig()

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
