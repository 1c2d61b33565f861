"""The records of a turn as the recorder takes them: truth, samples, times, frames, events."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from hil.log import packing, topics
from hil.names.changes import REFUSED
from hil.pacing import Slot
from hil.wire.messages import VALVES
from hil.wire.pulses import PulseOrder, unwrap_ns
from hil.wire.status import PlantStatus
from plant.answers import Answer, Answers
from plant.memory import Measured
from plant.rig import events as codes
from plant.rig.events import Event
from plant.rig.params import SECOND_NS, PlantParams
from plant.rig.state import Command, PlantState

_ROOM: Final = 4
"""Pulses of one tick that its record has room for."""
_SEVERITY: Final = {
    codes.CONTACT: topics.FAULT,
    codes.VALVE_CONTACT: topics.FAULT,
    codes.SAFE_STATE: topics.FAULT,
    codes.MISFIRE: topics.WARNING,
    codes.PULSE_REFUSED: topics.WARNING,
    codes.ORDER_REFUSED: topics.WARNING,
    REFUSED: topics.WARNING,
}


def _add_truth(tick: int, t_ns: int, s: PlantState) -> None:
    m, dc = s.motion, s.dead_centre
    packing.truth(
        tick, t_ns, m.x_m, m.v_m_s, dc.fuel_kg, s.machine.load_coefficient_n_s_m,
        s.disturbances.mask, dc.number, dc.t_ns, dc.x_m, s.contacts, dc.lambda_ratio,
        s.manifold.pressure_pa(t_ns),
    )  # fmt: skip


def pack_turn(
    slot: Slot, t_ns: int, sent_ns: int, measured: Measured, answer: Answer, before: PlantState
) -> bytes:
    """Pack what every tick has: sample, truth, times, the answer, the frames both ways.

    Parameters: before : the state in which the tick began
    """
    tick = slot.tick
    packing.begin()
    packing.sensor(
        tick, t_ns, measured.x_m, measured.v_m_s, measured.p_left_pa, measured.p_right_pa,
        measured.electric_power_w, 0,
    )  # fmt: skip
    _add_truth(tick, t_ns, before)
    packing.timing(tick, t_ns, slot.scheduled_ns, slot.woke_ns, sent_ns, answer.tick, 0)
    if answer.batches and answer.command is not None:
        _add_order(tick, t_ns, answer, answer.command, before)
    packing.frames_sent(tick, t_ns, measured.batch)
    for received in answer.batches:
        packing.frames_received(tick, t_ns, received)
    return packing.packed()


def _add_order(tick: int, t_ns: int, answer: Answer, command: Command, before: PlantState) -> None:
    """The decoded answer in SI, as it acts from this tick on."""
    order, pulses = command.machine or before.machine.order, command.pulses
    if pulses:
        a, b = _row(pulses, 0, t_ns), _row(pulses, 1, t_ns)
        c, d = _row(pulses, 2, t_ns), _row(pulses, 3, t_ns)
    else:
        a = b = c = d = (0, 0, 0)
    packing.actuator(
        tick, t_ns, answer.tick, order.mode, order.force_n, order.load_coefficient_n_s_m,
        answer.throttle, min(len(pulses), _ROOM),
        (a[0], b[0], c[0], d[0]), (a[1], b[1], c[1], d[1]), (a[2], b[2], c[2], d[2]),
    )  # fmt: skip


def _row(pulses: tuple[PulseOrder, ...], i: i64, now_ns: i64) -> tuple[i64, i64, i64]:
    """Channel, opening, duration of a pulse on the run's clock [ns]; zeros when there is none."""
    if i >= len(pulses):
        return 0, 0, 0
    pulse = pulses[i]
    return pulse.channel, unwrap_ns(pulse.open_us, now_ns), pulse.duration_us * 1000


def pack_skipped(tick: int, t_ns: int, woke_ns: int, before: PlantState) -> bytes:
    """Pack a tick whose slot has passed."""
    packing.begin()
    _add_truth(tick, t_ns, before)
    packing.timing(tick, t_ns, t_ns, woke_ns, woke_ns, -1, 1)
    return packing.packed()


def pack_events(tick: int, t_ns: int, events: tuple[Event, ...]) -> bytes:
    """Pack the events of a tick at their own instants, which lie inside it."""
    return b"".join(
        topics.EVENT.pack(
            tick,
            max(event.t_ns, t_ns),
            _SEVERITY.get(event.code, topics.INFO),
            event.code,
            event.text,
        )
        for event in events
    )


def status_of(
    slot: Slot, late_max_ns: int, state: PlantState, answers: Answers
) -> dict[str, object]:
    """How the plant is, but for what its loop counts."""
    return PlantStatus(
        t_s=float(slot.scheduled_ns) * 1e-9,
        tick=slot.tick,
        tdc_mm=abs(state.dead_centre.x_m) * 1e3 if state.dead_centre.number else None,
        late_us=(slot.woke_ns - slot.scheduled_ns) // 1000,
        late_max_us=late_max_ns // 1000,
        missed=0,
        answered=answers.answered,
        used_tick=answers.used_tick,
        safe=state.latch != 0,
        contacts=state.contacts,
        changes=0,
        reception=answers.decoder.counts()._asdict(),
    )._asdict()


def pack_valves(p: PlantParams, tick: int, before: PlantState, after: PlantState) -> bytes:
    """Pack the valves that have moved in a tick, each at its own instant."""
    waiting = max(len(before.pulses.valves.told) - 1, 0)  # one was told with this tick's sample
    moves = after.pulses.valves.told[waiting:]
    if not moves or not p.valves.by_lines:
        return b""
    gaps_m, t_ns = p.engine.gaps_m(after.motion), tick * p.period_ns
    data = b""
    for move in moves:
        way_m = after.x_m - _position_m(p, before, after, float(move.t_ns - t_ns) * 1e-9)
        gap_m = gaps_m[0] - way_m if move.line < 2 else gaps_m[1] + way_m
        data += topics.VALVE.pack(tick, move.t_ns, VALVES[0] + move.line, int(move.is_open), gap_m)
    return data


def pack_winding(p: PlantParams, tick: int, s: PlantState) -> bytes:
    """Pack the temperature of the winding with which a tick begins, once in a second of them."""
    if not p.config.winding.on or tick * p.period_ns % SECOND_NS >= p.period_ns:
        return b""
    i = s.instruments
    return topics.WINDING.pack(tick, tick * p.period_ns, i.winding_k, i.copper_w)


def _position_m(p: PlantParams, before: PlantState, after: PlantState, s: float) -> float:
    """Position s seconds into a tick: the cubic through both its ends [m]."""
    h = p.dt_s
    d = (after.x_m - before.x_m) / h
    c2 = (3.0 * d - 2.0 * before.v_m_s - after.v_m_s) / h
    c3 = (before.v_m_s + after.v_m_s - 2.0 * d) / (h * h)
    return before.x_m + s * (before.v_m_s + s * (c2 + c3 * s))
