"""What the pressure of a cylinder's cycle tells: knock, and whether its charge has burnt.

Knock is told by the ringing intensity of the steepest rise (Eng, SAE 2002-01-2859):
I = (beta dp/dt)^2 / (2 gamma p) sqrt(gamma R T), beta = 0.05 ms, with T by the ideal gas from the
charge at mid-stroke.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import i64

from hil.config.prototypes import Prototype
from hil.wire.messages import CylinderPeak

_RINGING_S: Final = 0.05e-3
_LEAST_GAP: Final = 1e-3
"""Of the half stroke: nearer to the head no volume is believed."""


def gap_m(engine: Prototype, side: i64, x_m: float) -> float:
    """Distance from a cylinder's head [m]."""
    gap = engine.half_stroke_m + (x_m if side == 0 else -x_m)
    return max(gap, _LEAST_GAP * engine.half_stroke_m)


def knock_w_m2(engine: Prototype, peak: CylinderPeak) -> float:
    """Ringing intensity of a cycle [W/m2]."""
    p_pa, gamma = peak.p_peak_pa, engine.gamma
    if p_pa <= 0.0:
        return 0.0
    compressed = gap_m(engine, peak.side, peak.x_peak_m) / engine.half_stroke_m
    kelvin = engine.t0_k * p_pa / engine.p0_pa * compressed
    rung_pa = _RINGING_S * peak.rise_pa_s
    return (
        rung_pa
        * rung_pa
        / (2.0 * gamma * p_pa)
        * math.sqrt(gamma * engine.gas_constant_j_kg_k * kelvin)
    )


def compression_pa(engine: Prototype, side: i64, tdc_m: float) -> float:
    """Pressure at a dead centre without a charge: p0 (Ls / gap)^gamma     (thesis eq. 5.9)."""
    x_m = -tdc_m if side == 0 else tdc_m
    return engine.p0_pa * math.pow(engine.half_stroke_m / gap_m(engine, side, x_m), engine.gamma)
