"""Level 4, timing: fuel mass and motion to injection and spark edges, predicted ahead to 1 us."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from controller.estimate import Motion, seconds_to_dead_centre
from hil.config.controller import ControllerConfig
from hil.wire.messages import INJECTOR_LEFT, SPARK_LEFT

_US = 1000

FAR_NS, FAR_EVERY = 4_000_000, 4
"""Further ahead than this a spark is placed anew every fourth tick only."""

SPARK_STEP_NS = 100_000
"""A thirtieth of the plant's spark window: a smaller correction is not worth a new order."""


class PlannedPulse(NamedTuple):
    """One pulse of a TTL line on the plant's clock [ns], on whole microseconds."""

    channel: int
    open_ns: int
    duration_ns: int

    @property
    def close_ns(self) -> int:
        """The instant at which the line goes low [ns]."""
        return self.open_ns + self.duration_ns


class Plan(NamedTuple):
    """The edges for the dead centre that ends this stroke; `fuel_kg` is what it will burn."""

    injection: PlannedPulse | None = None
    spark: PlannedPulse | None = None
    fuel_kg: float = 0.0


NO_PLAN = Plan()


def plan_injection(
    config: ControllerConfig,
    motion: Motion,
    t_ns: int,
    period_ns: int,
    stroke_s: float,
    fuel_kg: float,
) -> Plan:
    """Place the injection at mid-stroke, as late as is safe: until then a lost frame costs nothing.

    The line is high for dead time + fuel / flow, and has to be low before the dead centre. That
    lies as far from mid-stroke as in the stroke before or in the steady state, whichever is less,
    or up to a tenth nearer.
    """
    duration_us = (
        config.injector.dead_time_s * 1e6 + fuel_kg / config.injector.static_flow_kg_s * 1e6
    )
    duration_ns = max(round(duration_us), 1) * _US
    earliest_ns = t_ns + config.timing.injection_lead_ticks * period_ns
    low_by_ns = round(config.timing.injection_margin_s * 1e9)
    quarter_ns = min(motion.quarter_ns, round(0.5e9 * stroke_s))
    latest_ns = motion.mid_t_ns + quarter_ns * 9 // 10 - low_by_ns - duration_ns
    open_ns = _whole_us(max(earliest_ns, latest_ns))
    return Plan(
        PlannedPulse(INJECTOR_LEFT + _side_ahead(motion), open_ns, duration_ns), None, fuel_kg
    )


def retime_injection(
    config: ControllerConfig,
    plan: Plan,
    dead_centre_ns: int,
    t_ns: int,
    period_ns: int,
    fuel_kg: float,
) -> Plan:
    """Give an injection that may still be trimmed another fuel, and its place by the newest sample.

    Until the opening is `injection_lead_ticks` away it moves with the predicted dead centre, room
    left behind it for `trim_reserve` more fuel; from then on only the closing moves, as far as a
    command that acts from `act_ticks` on can still reach it.
    """
    old, timing = plan.injection, config.timing
    acts_ns = t_ns + timing.act_ticks * period_ns
    if old is None or old.close_ns <= acts_ns:
        return plan
    dead_s, flow = config.injector.dead_time_s, config.injector.static_flow_kg_s
    low_by_ns = dead_centre_ns - round(timing.trim_margin_s * 1e9)
    lead_ns = t_ns + timing.injection_lead_ticks * period_ns
    open_ns = old.open_ns
    if open_ns > lead_ns:
        room_s = dead_s + (1.0 + timing.trim_reserve) * fuel_kg / flow
        open_ns = _whole_us(max(lead_ns, low_by_ns - round(room_s * 1e9)))
    wanted_ns = open_ns + round((dead_s + fuel_kg / flow) * 1e6) * _US
    close_ns = max(min(wanted_ns, _whole_us(low_by_ns)), _whole_us(acts_ns))
    flowing_s = (close_ns - open_ns) * 1e-9 - dead_s
    burnt = fuel_kg if close_ns == wanted_ns else max(flowing_s * flow, 0.0)
    return plan._replace(
        injection=PlannedPulse(old.channel, open_ns, close_ns - open_ns), fuel_kg=burnt
    )


def plan_spark(
    config: ControllerConfig,
    plan: Plan,
    motion: Motion,
    t_ns: int,
    period_ns: int,
    stroke_s: float,
    ahead: Callable[[], float] | None = None,
) -> Plan:
    """Place the spark ahead of the predicted dead centre, again every tick until it is due.

    A command acts from `act_ticks` on, so a spark that opens before that is left as it is, and so
    is one that would move by less than `SPARK_STEP_NS`.

    Parameters: ahead : time from the sample to the dead centre, where there is a better prediction
    than that of a free oscillation
    """
    timing = config.timing
    acts_ns = t_ns + timing.act_ticks * period_ns
    if plan.spark is not None:
        ahead_ns = plan.spark.open_ns - acts_ns
        if ahead_ns <= 0 or (ahead_ns > FAR_NS and t_ns // period_ns % FAR_EVERY):
            return plan
    if ahead is None:
        seconds = seconds_to_dead_centre(motion, period_ns * 1e-9, math.pi / stroke_s)
    else:
        seconds = ahead()
    open_ns = motion.t_ns + round((seconds - timing.spark_advance_s) * 1e9)
    if open_ns - t_ns > timing.spark_ahead_s * 1e9:
        return plan
    if plan.spark is not None and abs(open_ns - plan.spark.open_ns) < SPARK_STEP_NS:
        return plan
    open_ns = _whole_us(max(open_ns, acts_ns))
    duration_ns = round(timing.spark_duration_s * 1e6) * _US
    spark = PlannedPulse(SPARK_LEFT + _side_ahead(motion), open_ns, duration_ns)
    return plan._replace(spark=spark)


def _side_ahead(motion: Motion) -> int:
    """0 when the piston moves to the left head, 1 when to the right."""
    return 1 if motion.direction > 0 else 0


def _whole_us(t_ns: int) -> int:
    """The next whole microsecond [ns]."""
    return -(-t_ns // _US) * _US
