"""The injection, as late as is safe: until then a lost frame costs nothing."""

from __future__ import annotations

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.timing.plan import US, Plan, PlannedPulse, Timings, whole_us
from hil.rounding import nearest
from hil.wire.messages import INJECTOR_LEFT


def plan_injection(
    timings: Timings, motion: Motion, t_ns: i64, period_ns: i64, stroke_s: float, fuel_kg: float
) -> Plan:
    """Place the injection at mid-stroke.

    The line is high for dead time + fuel / flow, and has to be low before the dead centre. That
    lies as far from mid-stroke as in the stroke before or in the steady state, whichever is less,
    or up to a tenth nearer.
    """
    duration_us = timings.dead_time_s * 1e6 + fuel_kg / timings.static_flow_kg_s * 1e6
    duration_ns = max(nearest(duration_us), 1) * US
    earliest_ns = t_ns + timings.injection_lead_ticks * period_ns
    low_by_ns = nearest(timings.injection_margin_s * 1e9)
    quarter_ns = min(motion.quarter_ns, nearest(0.5e9 * stroke_s))
    latest_ns = motion.mid_t_ns + quarter_ns * 9 // 10 - low_by_ns - duration_ns
    open_ns = whole_us(max(earliest_ns, latest_ns))
    return Plan(
        PlannedPulse(INJECTOR_LEFT + motion.side_ahead, open_ns, duration_ns), None, fuel_kg
    )


def retime_injection(
    timings: Timings, plan: Plan, dead_centre_ns: i64, t_ns: i64, period_ns: i64, fuel_kg: float
) -> Plan:
    """Give an injection that may still be trimmed another fuel, and its place by the newest sample.

    Until the opening is `injection_lead_ticks` away it moves with the predicted dead centre, room
    left behind it for `trim_reserve` more fuel; from then on only the closing moves, as far as a
    command that acts from `act_ticks` on can still reach it.
    """
    old = plan.injection
    acts_ns = t_ns + timings.act_ticks * period_ns
    if old is None or old.close_ns <= acts_ns:
        return plan
    dead_s, flow = timings.dead_time_s, timings.static_flow_kg_s
    low_by_ns = dead_centre_ns - nearest(timings.trim_margin_s * 1e9)
    lead_ns = t_ns + timings.injection_lead_ticks * period_ns
    open_ns = old.open_ns
    if open_ns > lead_ns:
        room_s = dead_s + (1.0 + timings.trim_reserve) * fuel_kg / flow
        open_ns = whole_us(max(lead_ns, low_by_ns - nearest(room_s * 1e9)))
    wanted_ns = open_ns + nearest((dead_s + fuel_kg / flow) * 1e6) * US
    close_ns = max(min(wanted_ns, whole_us(low_by_ns)), whole_us(acts_ns))
    flowing_s = float(close_ns - open_ns) * 1e-9 - dead_s
    burnt_kg = fuel_kg if close_ns == wanted_ns else max(flowing_s * flow, 0.0)
    return Plan(
        PlannedPulse(old.channel, open_ns, close_ns - open_ns),
        plan.spark,
        burnt_kg,
        -1.0,
        plan.work,
    )
