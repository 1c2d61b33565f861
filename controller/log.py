"""What a turn tells: records of what was sensed, ordered, sent and received; the status."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from controller.actuator import Machine
from controller.mode.start_restart import Mode
from controller.motion.own import OwnLaw
from controller.reception import Arrival, Reception
from controller.state import Output, Params, State, StrokeReport
from controller.supervision.protection import CycleReport
from controller.timing.plan import PlannedPulse
from hil.log import packing, topics
from hil.names.own import MOST
from hil.wire.status import ControllerStatus

MAX_LOGGED: Final = 4
"""Pulses of one tick that its record has room for."""

_NAN: Final = float("nan")
_FAULT_MODES: Final = (Mode.SAFE,)


def packed_tick(
    t_ns: int, arrival: Arrival, state: State, slow: list[float], output: Output, frames: bytes,
    woke_ns: int, done_ns: int, missed: bool,
) -> bytes:  # fmt: skip
    """Sample, answer and times of a tick, and the frames of both directions."""
    tick, motion, machine = arrival.tick, state.motion, output.machine
    fresh = arrival.sample is not None
    power_w, left_pa, right_pa = slow
    packing.begin()
    status = _status_of(arrival)
    packing.sensor(tick, t_ns, motion.x_m, motion.v_m_s, left_pa, right_pa, power_w, status)
    _add_answer(tick, t_ns, machine, output.throttle, output.pulses)
    packing.timing(tick, t_ns, t_ns, woke_ns, done_ns, tick if fresh else -1, missed)
    if arrival.batch:
        packing.frames_received(tick, t_ns, arrival.batch)
    if frames:
        packing.frames_sent(tick, t_ns, frames)
    return packing.packed()


def is_occasion(output: Output) -> bool:
    """Whether a stroke, an event or a cylinder's cycle is told."""
    return output.stroke is not None or bool(output.events) or output.cycle is not None


def packed_occasions(
    tick: int, t_ns: int, params: Params, state: State, output: Output, asked: bool
) -> bytes:
    """What happens in few ticks: a stroke ends, the law asks, a mode changes."""
    demand = state.fuelling.demand
    packing.begin()
    if output.stroke is not None:
        _add_stroke(tick, t_ns, output.stroke)
    if asked and demand.fuel_kg > 0.0:
        packing.demand(tick, t_ns, demand.fuel_kg, demand.v_ref_m_s)
    data = packing.packed()
    if output.cycle is not None:
        data += _cylinder(tick, t_ns, output.cycle)
    if asked and params.config.own.signals:
        data += _told(tick, t_ns, params, state)
    severity = topics.FAULT if state.mode in _FAULT_MODES else topics.INFO
    for code, text in output.events:
        data += topics.EVENT.pack(tick, t_ns, severity, code, text)
    return data


def _told(tick: int, t_ns: int, params: Params, state: State) -> bytes:
    """What a law of the user's own tells of itself, where it has just asked."""
    name, fuelling = params.config.own.name, state.fuelling
    law = params.laws.get(name)
    in_force = fuelling.law_name == name and fuelling.demand.fuel_kg > 0.0
    if not in_force or not isinstance(law, OwnLaw):
        return b""
    told = law.signals(fuelling.law)
    return topics.LAW.pack(tick, t_ns, (*told, *(_NAN,) * (MOST - len(told))))


def packed_note(tick: int, t_ns: int, code: str, text: str, batch: bytes) -> bytes:
    """Frames that are logged and never acted on, such as those of a tick already stepped."""
    packing.begin()
    packing.frames_received(tick, t_ns, batch)
    return packing.packed() + topics.EVENT.pack(tick, t_ns, topics.WARNING, code, text)


def _status_of(arrival: Arrival) -> int:
    """How the log marks the sample of a tick."""
    if arrival.sample is not None:
        return topics.SAMPLE_FRESH
    return topics.SAMPLE_INVALID if arrival.batch else topics.SAMPLE_NONE


def _add_answer(
    tick: int, t_ns: int, machine: Machine, throttle: float, pulses: tuple[PlannedPulse, ...]
) -> None:
    """What is asked of the machine, the throttle and the lines."""
    if pulses:
        a, b, c, d = _row(pulses, 0), _row(pulses, 1), _row(pulses, 2), _row(pulses, 3)
    else:
        a = b = c = d = (0, 0, 0)
    packing.actuator(
        tick, t_ns, tick, machine.mode, machine.force_n, machine.load_n_s_m, throttle,
        min(len(pulses), MAX_LOGGED),
        (a[0], b[0], c[0], d[0]), (a[1], b[1], c[1], d[1]), (a[2], b[2], c[2], d[2]),
    )  # fmt: skip


def _row(pulses: tuple[PlannedPulse, ...], i: i64) -> tuple[i64, i64, i64]:
    """Channel, opening and duration of a pulse [ns]; zeros when there is none."""
    if i >= len(pulses):
        return 0, 0, 0
    pulse = pulses[i]
    return pulse.channel, pulse.open_ns, pulse.duration_ns


def _add_stroke(tick: int, t_ns: int, stroke: StrokeReport) -> None:
    """One finished stroke with the terms of both loops."""
    demand = stroke.demand
    packing.stroke(
        stroke.number, tick, t_ns, stroke.side, stroke.tdc_m, stroke.tdc_ref_m, stroke.v_mid_m_s,
        demand.v_ref_m_s, demand.fuel_kg, demand.outer_p_m_s, demand.outer_i_m_s,
        demand.inner_p_kg, demand.inner_i_kg, _known(stroke.speed_hz),
        _known(stroke.power_w), _known(stroke.power_ref_w), _known(stroke.lambda_ratio),
    )  # fmt: skip


def _cylinder(tick: int, t_ns: int, cycle: CycleReport) -> bytes:
    """One cycle of a cylinder, and what is taken back after it."""
    peak = cycle.peak
    return topics.CYLINDER.pack(
        tick, t_ns, peak.side, peak.p_peak_pa, peak.x_peak_m, peak.rise_pa_s, cycle.knock_w_m2,
        cycle.verdict + 1, cycle.load_share, cycle.fuel_share, cycle.retard_m,
    )  # fmt: skip


def _known(value: float | None) -> float:
    """A figure of a stroke, nan when it is not known."""
    return _NAN if value is None else value


def status_of(
    tick: i64, period_ns: i64, state: State, output: Output, stroke: StrokeReport | None,
    reception: Reception,
) -> dict[str, object]:  # fmt: skip
    """How the controller is, but for what its loop counts; of strokes the last finished one."""
    return ControllerStatus(
        mode=state.mode.name.lower(),
        t_s=float(tick * period_ns) * 1e-9,
        tick=tick,
        tdc_mm=None if stroke is None else stroke.tdc_m * 1e3,
        tdc_ref_mm=state.set_points.tdc_ref_m * 1e3,
        fuel_mg=None if stroke is None else stroke.demand.fuel_kg * 1e6,
        speed_hz=None if stroke is None else stroke.speed_hz,
        power_w=None if stroke is None else stroke.power_w,
        power_ref_w=None if stroke is None else stroke.power_ref_w,
        load_n_s_m=output.machine.load_n_s_m,
        stale=state.stale,
        late_samples=0,
        implausible_samples=reception.implausible,
        changes=0,
        reception=reception.decoder.counts()._asdict(),
    )._asdict()
