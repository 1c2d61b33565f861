"""What the laws that trim within a stroke share: follow the charge, predict, fuel for the target.

The fuel takes the next stroke from the dead centre ahead to the set point, by the stroke's map.
"""

from __future__ import annotations

from controller.motion.charge import (
    NOTHING_FORESEEN,
    Charge,
    Forecast,
    Learning,
    align,
    foresee,
    learn,
    look_back,
)
from controller.motion.law import View


def at_dead_centre(
    config: Learning, learnt: Charge, forecast: Forecast, view: View, c: float, end_m: float
) -> tuple[Charge, Forecast]:
    """Learn from the stroke that has ended, and foresee the one that begins.

    Parameters: end_m : dead centre that was predicted for now, 0 when none was
    """
    motion = view.motion
    if learnt.known:
        before, learnt = learnt, learn(config, learnt, view, forecast, c)
        if end_m > 0.0 and learnt is not before:
            learnt = look_back(config, learnt, motion.tdc_m - end_m - learnt.ahead_m)
    else:
        learnt = align(config, learnt, view, c)
    if view.burnt_at(motion.side) <= 0.0:
        return learnt, NOTHING_FORESEEN
    q = learnt.effective_kg(view, motion.side)
    return learnt, foresee(learnt.map_of(view), q, c, motion.tdc_m, motion.dc_t_ns)


def rest_of_stroke(view: View, learnt: Charge, c: float) -> tuple[float, float]:
    """Where the stroke under way ends under the load c, and in how many seconds."""
    motion = view.motion
    q = learnt.effective_kg(view, motion.side)
    return learnt.map_of(view).travel(q, c, motion.z_m, motion.speed_m_s, motion.tau_s)


def fuel_after(view: View, learnt: Charge, c: float, end_m: float, planned_kg: float) -> float:
    """The fuel for the stroke from the predicted dead centre to the set point, in its limits.

    With a lag a stroke on what is enclosed already comes before that one.
    """
    share, believed = learnt.share_of(view.fuel_side), learnt.map_of(view)
    start = end_m + learnt.ahead_m
    if view.lag and view.enclosed_kg > 0.0:
        enclosed = learnt.share_of(1 - view.motion.side) * view.enclosed_kg
        start = believed.end_of(enclosed, c, start)
    q = believed.charge_for(c, start, view.tdc_ref_m, share * planned_kg)
    return view.limited_kg(q / share)
