"""The spark, placed ahead of the predicted dead centre, again every tick until it is due."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.timing.plan import US, Plan, PlannedPulse, Timings, whole_us
from hil.rounding import nearest
from hil.wire.messages import SPARK_LEFT

FAR_NS: Final = 4_000_000
FAR_EVERY: Final = 4
"""Further ahead than this a spark is placed anew every fourth tick only."""

SPARK_STEP_NS: Final = 100_000
"""A thirtieth of the plant's spark window: a smaller correction is not worth a new order."""

_LEFT: Final[i64] = SPARK_LEFT


def may_move(timings: Timings, plan: Plan, t_ns: i64, period_ns: i64) -> bool:
    """Whether the spark of a plan is to be placed in this tick.

    A command acts from `act_ticks` on, so a spark that opens before that is left as it is.
    """
    old = plan.spark
    if old is None:
        return True
    ahead_ns = old.open_ns - (t_ns + timings.act_ticks * period_ns)
    return ahead_ns > 0 and (ahead_ns <= FAR_NS or t_ns // period_ns % FAR_EVERY == 0)


def plan_spark(
    timings: Timings, plan: Plan, motion: Motion, t_ns: i64, period_ns: i64, seconds: float,
    lead_s: float, work: float = 1.0,
) -> Plan:  # fmt: skip
    """Place the spark, unless it would move by less than `SPARK_STEP_NS`.

    Parameters: seconds : time from the sample to the dead centre [s]; lead_s : from the spark to
        it; work : that the charge does with that lead
    """
    open_ns = motion.t_ns + nearest((seconds - lead_s) * 1e9)
    if float(open_ns - t_ns) > timings.spark_ahead_s * 1e9:
        return plan
    old = plan.spark
    if old is not None and -SPARK_STEP_NS < open_ns - old.open_ns < SPARK_STEP_NS:
        return plan
    open_ns = whole_us(max(open_ns, t_ns + timings.act_ticks * period_ns))
    duration_ns = nearest(timings.spark_duration_s * 1e6) * US
    spark = PlannedPulse(_LEFT + motion.side_ahead, open_ns, duration_ns)
    return Plan(plan.injection, spark, plan.fuel_kg, plan.later_kg, work)
