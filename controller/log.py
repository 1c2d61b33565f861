"""The records of a turn, packed: what was sensed, ordered, sent and received, and when."""

from __future__ import annotations

from typing import Final

from controller.mode.start_restart import Mode
from controller.motion.law import Demand
from controller.reception import Arrival
from controller.state import Output, State, StrokeReport
from controller.timing.plan import PlannedPulse
from hil.log import topics
from hil.log.records import together

MAX_LOGGED: Final = 4
"""Pulses of one tick that its record has room for."""

_NO_PULSES: Final = (0,) * 13  # none of them, then channels, openings and durations
_PADDING: Final = (0,) * MAX_LOGGED
_PACK_TICK: Final = together(topics.SENSOR, topics.ACTUATOR, topics.TIMING)
_FAULT_MODES: Final = (Mode.SAFE,)


def packed_tick(
    t_ns: int, arrival: Arrival, state: State, slow: list[float], output: Output, frames: bytes,
    woke_ns: int, done_ns: int, missed: bool,
) -> bytes:  # fmt: skip
    """Sample, answer and times of a tick, and the frames of both directions."""
    tick, motion, machine = arrival.tick, state.motion, output.machine
    fresh = arrival.sample is not None
    power_w, left_pa, right_pa = slow
    data = _PACK_TICK(
        tick, t_ns, motion.x_m, motion.v_m_s, left_pa, right_pa, power_w, _status_of(arrival),
        tick, machine.mode, machine.force_n, machine.load_n_s_m, output.throttle,
        *_columns_of(output.pulses), t_ns, woke_ns, done_ns, tick if fresh else -1, missed,
    )  # fmt: skip
    if arrival.batch:
        data += topics.FRAMES_RECEIVED.pack(tick, t_ns, arrival.batch)
    if frames:
        data += topics.FRAMES_SENT.pack(tick, t_ns, frames)
    return data


def packed_occasions(
    tick: int, t_ns: int, mode: Mode, output: Output, demand: Demand | None
) -> bytes:
    """What happens in few ticks: a stroke ends, the law asks, a mode changes."""
    data = b""
    if output.stroke is not None:
        data += _packed_stroke(tick, t_ns, output.stroke)
    if demand is not None and demand.fuel_kg > 0.0:
        data += topics.DEMAND.pack(tick, t_ns, demand.fuel_kg, demand.v_ref_m_s)
    severity = topics.FAULT if mode in _FAULT_MODES else topics.INFO
    for code, text in output.events:
        data += topics.EVENT.pack(tick, t_ns, severity, code, text)
    return data


def packed_note(tick: int, t_ns: int, code: str, text: str, batch: bytes) -> bytes:
    """Frames that are logged and never acted on, such as those of a tick already stepped."""
    event = topics.EVENT.pack(tick, t_ns, topics.WARNING, code, text)
    return topics.FRAMES_RECEIVED.pack(tick, t_ns, batch) + event


def _status_of(arrival: Arrival) -> int:
    """How the log marks the sample of a tick."""
    if arrival.sample is not None:
        return topics.SAMPLE_FRESH
    return topics.SAMPLE_INVALID if arrival.batch else topics.SAMPLE_NONE


def _columns_of(pulses: tuple[PlannedPulse, ...]) -> tuple[int, ...]:
    """How many pulses there are, then their channels, openings and durations, four of each."""
    if not pulses:
        return _NO_PULSES
    shown = pulses[:MAX_LOGGED]
    padding = _PADDING[len(shown) :]
    return (
        len(shown), *[p.channel for p in shown], *padding, *[p.open_ns for p in shown], *padding,
        *[p.duration_ns for p in shown], *padding,
    )  # fmt: skip


def _packed_stroke(tick: int, t_ns: int, stroke: StrokeReport) -> bytes:
    """One finished stroke with the terms of both loops."""
    demand = stroke.demand
    return topics.STROKE.pack(
        stroke.number, tick, t_ns, stroke.side, stroke.tdc_m, stroke.tdc_ref_m, stroke.v_mid_m_s,
        demand.v_ref_m_s, demand.fuel_kg, demand.outer_p_m_s, demand.outer_i_m_s,
        demand.inner_p_kg, demand.inner_i_kg,
    )  # fmt: skip
