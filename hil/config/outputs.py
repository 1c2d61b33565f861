"""Configuration of the TTL lines of real hardware."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.wire.messages import CHANNELS

LineOffset = Annotated[int, Field(ge=0, le=1023)]


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
