"""Where the piston will be, by the stroke's map: the dead centre ahead, the speed by now."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from controller.motion.maps.stroke_map import StrokeMap
from controller.observe.estimate import Motion, smooth_dead_centre_between
from hil.rounding import nearest

_MAP_ERROR: Final = 0.01
_MOST_STROKES: Final = 100
_SETTLED_M: Final = 1e-7


def seconds_ahead(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float]
) -> float:
    """Time from the newest sample to the dead centre ahead [s].

    After a stroke that did not fire, and while motoring, it is the stroke of the air springs.
    """
    q = burnt_kg[0] if motion.side == 0 else burnt_kg[1]
    return stroke_map.travel(q, load_n_s_m, motion.z_m, motion.speed_m_s, motion.tau_s)[1]


def seconds_to_spark(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float],
    position_m: float | None, advance_s: float,
) -> float:  # fmt: skip
    """Time to the spark, told as time to a dead centre `advance_s` behind it [s].

    The spark is at the position, if it has one, or `advance_s` before the dead centre if that is
    earlier: a stroke that falls short is lit nearer to mid-stroke.
    """
    ahead_s = seconds_ahead(stroke_map, motion, load_n_s_m, burnt_kg)
    if position_m is None:
        return ahead_s
    q = burnt_kg[0] if motion.side == 0 else burnt_kg[1]
    z, v, tau = motion.z_m, motion.speed_m_s, motion.tau_s
    return min(stroke_map.reach(q, load_n_s_m, z, v, tau, position_m) + advance_s, ahead_s)


def wanted_work(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, burnt_kg: tuple[float, float],
    target_m: float, fuel_kg: float,
) -> float:  # fmt: skip
    """What of its work a charge should do so that the stroke after it ends at a target, as a share.

    1 within what a map is wrong by.
    """
    q = burnt_kg[0] if motion.side == 0 else burnt_kg[1]
    end_m, _ = stroke_map.travel(q, load_n_s_m, motion.z_m, motion.speed_m_s, motion.tau_s)
    share = stroke_map.charge_for(load_n_s_m, end_m, target_m, fuel_kg) / fuel_kg
    return share if abs(share - 1.0) > _MAP_ERROR else 1.0


def steady_dead_centre(
    stroke_map: StrokeMap, fuel_kg: float, work: float, load_n_s_m: float, guess_m: float
) -> float:
    """The dead centre that strokes on a fuel and an ignition settle at: X = X_end(m w, c, X) [m].

    Parameters: work : of the charge by its spark's place, as a share of its planned one
    """
    end_m = guess_m
    for _ in range(_MOST_STROKES):
        before_m, end_m = end_m, stroke_map.end_of(fuel_kg * work, load_n_s_m, end_m)
        if abs(end_m - before_m) < _SETTLED_M:
            break
    return end_m


def unseen_dead_centre(
    stroke_map: StrokeMap | None, before: Motion, after: Motion, load_n_s_m: float,
    burnt_kg: tuple[float, float],
) -> Motion:  # fmt: skip
    """Return the motion with the dead centre of a gap in the samples as the stroke's map has it.

    Two samples on either side of a gap do not show where between them the piston turned. Without a
    map that could tell, the distance stays what it was: no law may act on a guess.

    Parameters: before, after : motion at the last sample before the gap, at the first one behind it
    """
    if stroke_map is not None:
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

    Where the gas hardens within a tick, a constant acceleration misses the turn by 30 us. A map
    that tells no force cannot say more of a tick than its two samples do.
    """
    if not stroke_map.tells_force:
        dc_t_ns, x_m = smooth_dead_centre_between(
            before.t_ns, before.x_m, before.v_m_s, after.t_ns, after.x_m, after.v_m_s
        )
        return _ended(after, abs(x_m), dc_t_ns, 0)
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
    return _ended(after, tdc_m, dc_t_ns, quarter_ns)


def _ended(after: Motion, tdc_m: float, dc_t_ns: i64, quarter_ns: i64) -> Motion:
    """The motion with that dead centre behind it; a quarter of 0 is counted from there."""
    if quarter_ns == 0 and after.quarter_ns != 0:
        quarter_ns = after.quarter_ns + dc_t_ns - after.dc_t_ns
    return after.ended_at(tdc_m, dc_t_ns, quarter_ns)


def speeds(
    stroke_map: StrokeMap, motion: Motion, load_n_s_m: float, fuel_kg: float
) -> tuple[float, float]:
    """Speeds that the piston should have by now: with the charge burnt, and with none [m/s]."""
    fired = stroke_map.speed_at(fuel_kg, load_n_s_m, motion.tdc_m, motion.tau_s)
    return fired, stroke_map.speed_at(0.0, load_n_s_m, motion.tdc_m, motion.tau_s)
