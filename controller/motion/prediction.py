"""Where the piston will be, by the stroke's map: the dead centre ahead, the speed by now."""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.motion.stroke_map import StrokeMap
from controller.observe.estimate import Motion, seconds_to_dead_centre


def seconds_ahead(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float],
    period_ns: int,
) -> float:  # fmt: skip
    """Time from the newest sample to the dead centre ahead [s].

    By the stroke's own map; that of a free oscillation where the engine is of another kind. After
    a stroke that did not fire, and while motoring, it is the stroke of the air springs.
    """
    if not stroke_map.fits:
        return seconds_to_dead_centre(motion, period_ns * 1e-9, math.pi / stroke_map.stroke_s)
    q = burnt_kg[motion.side]
    return stroke_map.travel(q, load_n_s_m, motion.z_m, motion.speed_m_s, motion.tau_s)[1]


def ahead_by(
    stroke_map: StrokeMap | None, motion: Motion, load_n_s_m: float,
    burnt_kg: tuple[float, float], period_ns: int,
) -> Callable[[], float] | None:  # fmt: skip
    """The same, to be called if it is needed; None without a map that could tell."""
    if stroke_map is None or not stroke_map.fits:
        return None
    return lambda: seconds_ahead(stroke_map, motion, load_n_s_m, burnt_kg, period_ns)


def speeds(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, fuel_kg: float
) -> tuple[float, float]:
    """Speeds that the piston should have by now: with the charge burnt, and with none [m/s]."""
    fired, unfired = (
        stroke_map.path(q, load_n_s_m, -motion.tdc_m, 0.0, 0.0).at(motion.tau_s)[1]
        for q in (fuel_kg, 0.0)
    )
    return fired, unfired
