"""The timing layer: when edges are placed, what is believed of injectors and valves."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hil.config.base import FIXED, Section, Tunable
from hil.config.charge.ignition import Leads, Works

Metres = Annotated[float, Field(gt=0.0, le=0.05)]
StrokeTime = Annotated[float, Field(gt=0.0, le=1.0)]
Gap = Annotated[float, Field(gt=0.0, le=0.1)]
Delay = Annotated[float, Field(ge=0.0, le=0.05)]


class TimingConfig(Tunable):
    """When edges are placed (level 4).

    act_ticks: ticks after a sample from which its answer is sure to act; what is due before stays
    spark_position_m: where the spark is, as distance from mid-stroke; else it comes
        spark_advance_s before the predicted dead centre
    spark_trim: whether the spark corrects the dead centre that it is too late to correct by fuel
    spark_lead_s, spark_factor: work of a charge by the time from spark to dead centre, as the
        plant's map unless given
    fires: which strokes end in a combustion, over and over from the first one of the run
    trim_reserve: room behind an injection for more fuel, as a share of it, where the law may trim
    trim_margin_s: time before the dead centre by which also such fuel has flowed
    valves: who moves the valves of an engine that has valve lines: a programme of the plant's own,
        by the piston's position, or the controller
    """

    spark_position_m: float | None = Field(default=None, gt=0.0, le=0.05)
    valves: Literal["programme", "controller"] = Field("programme", json_schema_extra=FIXED)
    fires: tuple[bool, ...] = Field((True,), min_length=1, max_length=8, json_schema_extra=FIXED)
    spark_advance_s: float = Field(default=1.5e-3, ge=0.2e-3, le=8.0e-3)
    spark_trim: bool = False
    spark_lead_s: Leads = ()
    spark_factor: Works = ()
    spark_duration_s: float = Field(default=0.5e-3, ge=0.01e-3, le=2.0e-3)
    spark_ahead_s: float = Field(default=10.0e-3, ge=1.0e-3, le=20.0e-3)
    injection_lead_ticks: int = Field(default=3, ge=1, le=20)
    injection_margin_s: float = Field(default=1.0e-3, ge=0.0, le=5.0e-3)
    act_ticks: int = Field(default=1, ge=1, le=20)
    trim_reserve: float = Field(default=0.35, ge=0.0, le=1.0)
    trim_margin_s: float = Field(default=0.3e-3, ge=0.0, le=5.0e-3)


class ValvesKnowledge(Section):
    """Where valves are to move, and what the controller believes of their actuators.

    cycle: two-stroke by the distances below (Table 3.3), four-stroke at dead centres (Table 3.1)
    exhaust_opens_m, ...: distance of the piston from the valve's head
    first_stroke: stroke of the cycle with which a running engine begins
    stroke_s: duration of each stroke of the cycle from that one on, until they have been seen
    opening_delay_s, closing_delay_s: from the line's edge to the valve's move, until it is learnt
    dead_centre_lead_s: how long before a dead centre a valve moves that belongs to it: while it has
        not moved the piston creeps on, and the dead centre comes the later the later the valve does
    gain: part of a move's error that is learnt, once many have been seen; 0 learns no more then
    """

    cycle: Literal["two-stroke", "four-stroke"] = "two-stroke"
    exhaust_opens_m: Gap = 0.023
    exhaust_closes_m: Gap = 0.031
    intake_opens_m: Gap = 0.028
    intake_closes_m: Gap = 0.034
    first_stroke: int = Field(default=0, ge=0, le=3)
    stroke_s: tuple[StrokeTime, ...] = Field(default=(), max_length=4)
    opening_delay_s: Delay = 0.0
    closing_delay_s: Delay = 0.0
    delay_max_s: Delay = 0.02
    dead_centre_lead_s: Delay = 0.25e-3
    gain: float = Field(default=0.05, ge=0.0, le=1.0)
