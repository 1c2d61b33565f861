"""Ranges of the quantities that several sections of the configuration hold, each stated once."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hil.config.base import ranged
from hil.wire.commands import TDC_REF_M

MassKg = Annotated[float, Field(gt=0.01, le=1000.0)]
LengthM = Annotated[float, Field(gt=0.001, le=1.0)]
TdcRefM = Annotated[float, ranged(TDC_REF_M)]
PositionM = Annotated[float, Field(ge=0.0, le=1.0)]
Ratio = Annotated[float, Field(gt=1.0, le=40.0)]
Gamma = Annotated[float, Field(gt=1.01, le=1.67)]
PressurePa = Annotated[float, Field(ge=1.0e4, le=1.0e7)]
TemperatureK = Annotated[float, Field(ge=200.0, le=1000.0)]
GasConstant = Annotated[float, Field(ge=100.0, le=5000.0)]
HeatingValue = Annotated[float, Field(ge=1.0e6, le=2.0e8)]
LoadCoefficient = Annotated[float, Field(ge=0.0, le=10_000.0)]
CommandedLoad = Annotated[float, Field(ge=0.0, le=5000.0)]
ForceN = Annotated[float, Field(ge=0.0, le=20_000.0)]
StartForceN = Annotated[float, Field(gt=0.0, le=4000.0)]
Restitution = Annotated[float, Field(ge=0.0, le=0.95)]
FuelKg = Annotated[float, Field(gt=0.0, le=1.0e-3)]
FlowKgS = Annotated[float, Field(gt=0.0, le=0.1)]
DeadTimeS = Annotated[float, Field(ge=0.0, le=0.01)]
StaleS = Annotated[float, Field(gt=0.0, le=10.0)]
"""So long a silence of the peer, or age of what it sent, is borne; beyond it is the safe state."""

STALE_S = 0.010
"""How long that is unless it is given, on both sides."""

LEAST_STALE_TICKS = 3


def stale_ticks(stale_s: float, period_ns: int) -> int:
    """The first count of silent ticks that is beyond the time; three at the least."""
    return max(round(stale_s * 1e9) // period_ns + 1, LEAST_STALE_TICKS)
