"""The records of a turn as the recorder takes them: truth, samples, times, frames, events."""

from __future__ import annotations

from typing import Final

from hil.log import topics
from hil.log.records import together
from hil.pacing import Slot
from hil.wire.pulses import PulseOrder, unwrap_ns
from plant.answers import Answer
from plant.memory import Measured
from plant.rig import events as codes
from plant.rig.events import Event
from plant.rig.state import Command, PlantState

_NO_PULSES: Final = (0,) * 13  # none of them, then channels, openings and durations
_PADDING: Final = ((0, 0, 0),) * 4
_PACK_TICK: Final = together(topics.SENSOR, topics.TRUTH, topics.TIMING)
_PACK_ANSWERED: Final = together(topics.SENSOR, topics.TRUTH, topics.TIMING, topics.ACTUATOR)
_SEVERITY: Final = {
    codes.CONTACT: topics.FAULT,
    codes.SAFE_STATE: topics.FAULT,
    codes.MISFIRE: topics.WARNING,
    codes.PULSE_REFUSED: topics.WARNING,
    codes.ORDER_REFUSED: topics.WARNING,
}


def truth(s: PlantState) -> tuple[float, ...]:
    """What the log holds of a state: the fields of /truth after its tick and instant."""
    m, dc = s.motion, s.dead_centre
    return (
        m.x_m, m.v_m_s, dc.fuel_kg, s.machine.load_coefficient_n_s_m, s.disturbances.mask,
        dc.number, dc.t_ns, dc.x_m, s.contacts,
    )  # fmt: skip


def pack_turn(
    slot: Slot, t_ns: int, sent_ns: int, measured: Measured, answer: Answer, before: PlantState
) -> bytes:
    """Pack what every tick has: sample, truth, times, the answer, the frames both ways.

    Parameters: before : the state in which the tick began
    """
    tick = slot.tick
    values = (
        tick, t_ns, measured.x_m, measured.v_m_s, measured.p_left_pa, measured.p_right_pa,
        measured.electric_power_w, 0, *truth(before),
        slot.scheduled_ns, slot.woke_ns, sent_ns, answer.tick, 0,
    )  # fmt: skip
    if answer.batches and answer.command is not None:
        data = _PACK_ANSWERED(*values, *_ordered(t_ns, answer, answer.command, before))
    else:
        data = _PACK_TICK(*values)
    data += topics.FRAMES_SENT.pack(tick, t_ns, measured.batch)
    for received in answer.batches:
        data += topics.FRAMES_RECEIVED.pack(tick, t_ns, received)
    return data


def _ordered(t_ns: int, answer: Answer, command: Command, before: PlantState) -> tuple[float, ...]:
    """The decoded answer in SI, as it acts from this tick on: the fields of /actuator."""
    order = command.machine or before.machine.order
    head = (answer.tick, order.mode, order.force_n, order.load_coefficient_n_s_m, answer.throttle)
    if not command.pulses:
        return (*head, *_NO_PULSES)
    rows = [unwrapped(pulse, t_ns) for pulse in command.pulses[: len(_PADDING)]]
    columns = zip(*(*rows, *_PADDING[len(rows) :]), strict=True)
    channels, opens, durations = columns
    return (*head, len(rows), *channels, *opens, *durations)


def pack_skipped(tick: int, t_ns: int, woke_ns: int, before: PlantState) -> bytes:
    """Pack a tick whose slot has passed."""
    times = topics.TIMING.pack(tick, t_ns, t_ns, woke_ns, woke_ns, -1, 1)
    return topics.TRUTH.pack(tick, t_ns, *truth(before)) + times


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


def unwrapped(pulse: PulseOrder, now_ns: int) -> tuple[int, int, int]:
    """(channel, opening, duration) of an order on the run's clock [ns]."""
    return pulse.channel, unwrap_ns(pulse.open_us, now_ns), pulse.duration_us * 1000
