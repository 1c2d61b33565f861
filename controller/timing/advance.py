"""The pulses of the dead centre ahead, ordered long before it and replaced when more is known.

A stall of some milliseconds about mid-stroke would leave no time for an injection. So once it is
known that a charge has burnt, the next one is ordered on the steady fuel; at mid-stroke the law's
own order takes its place, ordinarily long before anything of it is due.
"""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.timing.plan import NO_PLAN, US, Plan, PlannedPulse, Timings, whole_us
from hil.rounding import nearest
from hil.wire.messages import INJECTOR_LEFT, SPARK_LEFT

EARLIER_NS: Final = 500_000
"""By so much sooner than at its latest the injection is over: what a prediction may be wrong."""

NEAR_S: Final = 4.0e-3
"""Without a map a spark further ahead than this is better placed by a steady stroke."""

_SPARK: Final[i64] = SPARK_LEFT


def plan_ahead(
    timings: Timings, motion: Motion, dead_centre_ns: i64, period_ns: i64, stroke_s: float,
    fuel_kg: float,
) -> Plan:  # fmt: skip
    """Place injection and spark for a predicted dead centre [ns].

    Nothing is ordered that could be due before the law's own order is sure to have replaced it;
    where orders are delayed, that could flow before the law's own closing acts.
    """
    duration_us = timings.dead_time_s * 1e6 + fuel_kg / timings.static_flow_kg_s * 1e6
    duration_ns = max(nearest(duration_us), 1) * US
    low_by_ns = dead_centre_ns - nearest(timings.injection_margin_s * 1e9) - EARLIER_NS
    open_ns = whole_us(low_by_ns - duration_ns)
    mid_ns = motion.dc_t_ns + nearest(0.5e9 * stroke_s)
    if timings.act_ticks > 1:
        flows_ns = open_ns + nearest(timings.dead_time_s * 1e9)
        is_early = flows_ns < mid_ns + (timings.act_ticks + 1) * period_ns
    else:
        is_early = open_ns < mid_ns + (timings.injection_lead_ticks + 2) * period_ns
    if is_early:
        return NO_PLAN
    spark_ns = whole_us(dead_centre_ns - nearest(timings.spark_advance_s * 1e9))
    lasts_ns = nearest(timings.spark_duration_s * 1e6) * US
    side = motion.side_ahead
    return Plan(
        PlannedPulse(INJECTOR_LEFT + side, open_ns, duration_ns),
        PlannedPulse(_SPARK + side, spark_ns, lasts_ns), fuel_kg,
    )  # fmt: skip


def continued(timings: Timings, ahead: Plan, plan: Plan, acts_ns: i64) -> Plan:
    """Let an injection go on that opens before a new order acts: that gives it its closing."""
    old, new = ahead.injection, plan.injection
    if old is None or new is None or old.open_ns >= acts_ns:
        return plan
    close_ns = max(old.open_ns + new.duration_ns, acts_ns)
    return Plan(PlannedPulse(old.channel, old.open_ns, close_ns - old.open_ns), None, plan.fuel_kg)


def postponed(timings: Timings, plan: Plan, dead_centre_ns: i64) -> Plan:
    """Place an injection as late as it may be: the plant does not hear, and may do so by then."""
    old = plan.injection
    if old is None:
        return plan
    low_by_ns = dead_centre_ns - nearest(timings.injection_margin_s * 1e9)
    open_ns = max(old.open_ns, whole_us(low_by_ns - old.duration_ns))
    later = PlannedPulse(old.channel, open_ns, old.duration_ns)
    return Plan(later, plan.spark, plan.fuel_kg, plan.later_kg, plan.work)


def is_far(
    timings: Timings, plan: Plan, pulses: tuple[PlannedPulse, ...], side: i64, seconds: float
) -> bool:
    """Whether the spark that was ordered ahead for that side is to stay for now.

    Parameters: seconds : to the dead centre, as a free oscillation [s]
    """
    if plan.spark is not None or seconds - timings.spark_advance_s < NEAR_S:
        return False
    return any(pulse.channel == _SPARK + side for pulse in pulses)
