"""The spark, placed ahead of the predicted dead centre, again every tick until it is due."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from controller.observe.estimate import Motion, seconds_to_dead_centre
from controller.timing.plan import US, Plan, PlannedPulse, whole_us
from hil.config.controller import ControllerConfig
from hil.wire.messages import SPARK_LEFT

FAR_NS: Final = 4_000_000
FAR_EVERY: Final = 4
"""Further ahead than this a spark is placed anew every fourth tick only."""

SPARK_STEP_NS: Final = 100_000
"""A thirtieth of the plant's spark window: a smaller correction is not worth a new order."""


def plan_spark(
    config: ControllerConfig, plan: Plan, motion: Motion, t_ns: int, period_ns: int,
    stroke_s: float, ahead: Callable[[], float] | None = None,
) -> Plan:  # fmt: skip
    """Place the spark.

    A command acts from `act_ticks` on, so a spark that opens before that is left as it is, and so
    is one that would move by less than `SPARK_STEP_NS`.

    Parameters: ahead : time from the sample to the dead centre, where there is a better prediction
    than that of a free oscillation
    """
    timing, old = config.timing, plan.spark
    acts_ns = t_ns + timing.act_ticks * period_ns
    if old is not None:
        ahead_ns = old.open_ns - acts_ns
        if ahead_ns <= 0 or (ahead_ns > FAR_NS and t_ns // period_ns % FAR_EVERY):
            return plan
    if ahead is None:
        seconds = seconds_to_dead_centre(motion, period_ns * 1e-9, math.pi / stroke_s)
    else:
        seconds = ahead()
    open_ns = motion.t_ns + round((seconds - timing.spark_advance_s) * 1e9)
    if open_ns - t_ns > timing.spark_ahead_s * 1e9:
        return plan
    if old is not None and abs(open_ns - old.open_ns) < SPARK_STEP_NS:
        return plan
    duration_ns = round(timing.spark_duration_s * 1e6) * US
    spark = PlannedPulse(
        SPARK_LEFT + motion.side_ahead, whole_us(max(open_ns, acts_ns)), duration_ns
    )
    return Plan(plan.injection, spark, plan.fuel_kg)
