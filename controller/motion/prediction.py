"""Where the piston will be, by the stroke's map: the dead centre ahead, the speed by now."""

from __future__ import annotations

import math

from mypy_extensions import i64

from controller.motion.stroke_map import StrokeMap
from controller.observe.estimate import Motion, seconds_to_dead_centre


def seconds_ahead(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float],
    period_ns: i64,
) -> float:  # fmt: skip
    """Time from the newest sample to the dead centre ahead [s].

    By the stroke's own map; that of a free oscillation where the engine is of another kind. After
    a stroke that did not fire, and while motoring, it is the stroke of the air springs.
    """
    if not stroke_map.fits:
        h = float(period_ns) * 1e-9
        return seconds_to_dead_centre(motion, h, math.pi / stroke_map.stroke_s)
    q = burnt_kg[0] if motion.side == 0 else burnt_kg[1]
    return stroke_map.travel(q, load_n_s_m, motion.z_m, motion.speed_m_s, motion.tau_s)[1]


def speeds(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, fuel_kg: float
) -> tuple[float, float]:
    """Speeds that the piston should have by now: with the charge burnt, and with none [m/s]."""
    fired = stroke_map.path(fuel_kg, load_n_s_m, -motion.tdc_m, 0.0, 0.0)
    unfired = stroke_map.path(0.0, load_n_s_m, -motion.tdc_m, 0.0, 0.0)
    return fired.at(motion.tau_s)[1], unfired.at(motion.tau_s)[1]
