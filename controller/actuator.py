"""Level 5, actuator: modes and planned edges to machine command and TTL frames."""

from __future__ import annotations

from typing import NamedTuple

from controller.start_restart import Mode
from controller.timing import PlannedPulse
from hil.messages import (
    GENERATOR,
    MOTOR,
    OFF,
    PULSE_CLOCK_US,
    ControllerTick,
    MachineCommand,
    Message,
    Pulse,
)
from hil.signals import layout_of

MAX_PULSES = layout_of(Pulse).per_tick
"""Pulse frames of one tick: six frames a tick in both directions, four of them fixed."""


class Machine(NamedTuple):
    """What the machine is to do."""

    mode: int
    force_n: float = 0.0
    load_n_s_m: float = 0.0


def machine_for(mode: Mode, force_n: float, load_n_s_m: float, full_load_n_s_m: float) -> Machine:
    """The machine's part in each operating mode; the safe state brakes at full load.

    Removing the load would not be safe: the piston would go on oscillating (thesis section 5.3).
    """
    if mode is Mode.GENERATING:
        return Machine(GENERATOR, 0.0, load_n_s_m)
    if mode is Mode.MOTORING:
        return Machine(MOTOR, force_n, 0.0)
    if mode is Mode.OFF:
        return Machine(OFF)
    return Machine(GENERATOR, 0.0, full_load_n_s_m)


def still_open(
    pulses: tuple[PlannedPulse, ...], planned: tuple[PlannedPulse | None, ...], t_ns: int
) -> tuple[PlannedPulse, ...]:
    """Pulses to send in this tick: those not closed yet, a newly planned one replacing its channel.

    They are sent again every tick until they have closed, so that one lost frame costs nothing.
    """
    for pulse in planned:
        if pulse is not None and pulse not in pulses:
            break
    else:  # nothing new
        for _, open_ns, duration_ns in pulses:
            if open_ns + duration_ns <= t_ns:
                break
        else:
            return pulses
    new = [pulse for pulse in planned if pulse is not None]
    channels = [pulse.channel for pulse in new]
    kept = [pulse for pulse in pulses if pulse.channel not in channels]
    alive = [pulse for pulse in kept + new if pulse.close_ns > t_ns]
    alive.sort(key=lambda pulse: pulse.open_ns)
    return tuple(alive)


def messages(
    tick: int, mode: Mode, machine: Machine, throttle: float, pulses: tuple[PlannedPulse, ...]
) -> tuple[Message, ...]:
    """The messages that answer a sample."""
    command = MachineCommand(machine.mode, machine.force_n, machine.load_n_s_m, throttle)
    if not pulses:
        return (ControllerTick(tick, 2, int(mode)), command)
    sent = [
        Pulse(channel, open_ns // 1000 % PULSE_CLOCK_US, duration_ns // 1000)
        for channel, open_ns, duration_ns in pulses[:MAX_PULSES]
    ]
    return (ControllerTick(tick, 2 + len(sent), int(mode)), command, *sent)
