"""Where the piston will be, by the stroke's map: the dead centre ahead, the speed by now."""

from __future__ import annotations

import math

from mypy_extensions import i64

from controller.motion.maps.stroke_map import StrokeMap
from controller.observe.estimate import Motion, seconds_to_dead_centre
from hil.rounding import nearest


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


def unseen_dead_centre(
    stroke_map: StrokeMap | None, before: Motion, after: Motion, load_n_s_m: float,
    burnt_kg: tuple[float, float],
) -> Motion:  # fmt: skip
    """Return the motion with the dead centre of a gap in the samples as the stroke's map has it.

    Two samples on either side of a gap do not show where between them the piston turned. Without a
    map that could tell, the distance stays what it was: no law may act on a guess.

    Parameters: before, after : motion at the last sample before the gap, at the first one behind it
    """
    if stroke_map is not None and stroke_map.fits:
        told = _turned(stroke_map, before, after, load_n_s_m, burnt_kg, before.quarter_ns)
        if told is not None:
            return told
    known = before.tdc_m if before.tdc_m > 0.0 else after.tdc_m
    return after.ended_at(known, after.dc_t_ns, before.quarter_ns)


def dead_centre(
    stroke_map: StrokeMap, before: Motion, after: Motion, load_n_s_m: float,
    burnt_kg: tuple[float, float],
) -> Motion:  # fmt: skip
    """Return the motion with the dead centre between two samples as the stroke's map has it.

    Where the gas hardens within a tick, a constant acceleration misses the turn by 30 us.
    """
    told = _turned(stroke_map, before, after, load_n_s_m, burnt_kg, 0)
    return after if told is None else told


def _turned(
    stroke_map: StrokeMap, before: Motion, after: Motion, load_n_s_m: float,
    burnt_kg: tuple[float, float], quarter_ns: i64,
) -> Motion | None:  # fmt: skip
    """The motion with its dead centre by the map; None when that lies outside of the two samples.

    Parameters: quarter_ns : from mid-stroke to the dead centre, 0 to count it from here
    """
    q = burnt_kg[0] if before.side == 0 else burnt_kg[1]
    tdc_m, seconds = stroke_map.travel(q, load_n_s_m, before.z_m, before.speed_m_s, before.tau_s)
    dc_t_ns = before.t_ns + nearest(seconds * 1e9)
    if not before.t_ns <= dc_t_ns <= after.t_ns:
        return None
    if quarter_ns == 0 and after.quarter_ns != 0:
        quarter_ns = after.quarter_ns + dc_t_ns - after.dc_t_ns
    return after.ended_at(tdc_m, dc_t_ns, quarter_ns)


def speeds(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, fuel_kg: float
) -> tuple[float, float]:
    """Speeds that the piston should have by now: with the charge burnt, and with none [m/s]."""
    fired = stroke_map.speed_at(fuel_kg, load_n_s_m, motion.tdc_m, motion.tau_s)
    return fired, stroke_map.speed_at(0.0, load_n_s_m, motion.tdc_m, motion.tau_s)
