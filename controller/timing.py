"""Level 4, timing: fuel mass and motion to injection and spark edges, predicted ahead to 1 us."""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.estimate import Motion, seconds_to_dead_centre
from hil.config.controller import ControllerConfig
from hil.messages import INJECTOR_LEFT, SPARK_LEFT

_US = 1000


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
    config: ControllerConfig, motion: Motion, t_ns: int, period_ns: int, fuel_kg: float
) -> Plan:
    """Place the injection at mid-stroke, as early as a lost frame leaves time to repeat it.

    The line is high for dead time + fuel / flow.
    """
    duration_us = (
        config.injector.dead_time_s * 1e6 + fuel_kg / config.injector.static_flow_kg_s * 1e6
    )
    open_ns = _whole_us(t_ns + config.timing.injection_lead_ticks * period_ns)
    channel = INJECTOR_LEFT + _side_ahead(motion)
    return Plan(PlannedPulse(channel, open_ns, max(round(duration_us), 1) * _US), None, fuel_kg)


def plan_spark(
    config: ControllerConfig,
    plan: Plan,
    motion: Motion,
    t_ns: int,
    period_ns: int,
    stroke_s: float,
) -> Plan:
    """Place the spark ahead of the predicted dead centre, again every tick until it is due.

    A command acts from the next tick, so a spark that opens before that is left as it is.
    """
    timing = config.timing
    if plan.spark is not None and plan.spark.open_ns <= t_ns + period_ns:
        return plan
    seconds = seconds_to_dead_centre(motion, period_ns * 1e-9, math.pi / stroke_s)
    open_ns = motion.t_ns + round((seconds - timing.spark_advance_s) * 1e9)
    if open_ns - t_ns > timing.spark_ahead_s * 1e9:
        return plan
    open_ns = _whole_us(max(open_ns, t_ns + period_ns))
    duration_ns = round(timing.spark_duration_s * 1e6) * _US
    spark = PlannedPulse(SPARK_LEFT + _side_ahead(motion), open_ns, duration_ns)
    return plan._replace(spark=spark)


def _side_ahead(motion: Motion) -> int:
    """0 when the piston moves to the left head, 1 when to the right."""
    return 1 if motion.direction > 0 else 0


def _whole_us(t_ns: int) -> int:
    """The next whole microsecond [ns]."""
    return -(-t_ns // _US) * _US
