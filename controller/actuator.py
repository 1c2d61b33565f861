"""Level 5, actuator: modes and planned edges to machine command and TTL frames."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.mode.start_restart import GENERATING, Mode
from controller.mode.start_restart import OFF as AT_REST
from controller.timing.plan import PlannedPulse
from hil.values import Value
from hil.wire.fields import layout_of
from hil.wire.messages import (
    GENERATOR,
    OFF,
    ControllerTick,
    MachineCommand,
    Message,
    Pulse,
)
from hil.wire.pulses import wrap_us

MAX_PULSES: Final = layout_of(Pulse).per_tick
"""Pulse frames of one tick: six frames a tick in both directions, four of them fixed."""

_NONE: Final[tuple[Message, ...]] = ()


@final
class Machine(Value):
    """An order to the machine."""

    __slots__ = ("mode", "force_n", "load_n_s_m")

    def __init__(self, mode: i64, force_n: float = 0.0, load_n_s_m: float = 0.0) -> None:
        self.mode = mode
        self.force_n = force_n
        self.load_n_s_m = load_n_s_m


def machine_for(mode: Mode, load_n_s_m: float, full_load_n_s_m: float) -> Machine:
    """The machine's part in each mode but motoring; the safe state brakes at full load.

    Removing the load would not be safe: the piston would go on oscillating (thesis section 5.3).
    """
    if mode is GENERATING:
        return Machine(GENERATOR, 0.0, load_n_s_m)
    if mode is AT_REST:
        return Machine(OFF)
    return Machine(GENERATOR, 0.0, full_load_n_s_m)


def still_open(
    pulses: tuple[PlannedPulse, ...], injection: PlannedPulse | None, spark: PlannedPulse | None,
    t_ns: i64,
) -> tuple[PlannedPulse, ...]:  # fmt: skip
    """Pulses to send in this tick: those not closed yet, a newly planned one replacing its channel.

    They are sent again every tick until they have closed, so that one lost frame costs nothing.
    """
    if _nothing_changes(pulses, injection, spark, t_ns):
        return pulses
    new = [pulse for pulse in (injection, spark) if pulse is not None]
    channels = [pulse.channel for pulse in new]
    kept = [pulse for pulse in pulses if pulse.channel not in channels]
    alive = [pulse for pulse in kept + new if pulse.close_ns > t_ns]
    alive.sort(key=lambda pulse: pulse.open_ns)
    return tuple(alive)


def _nothing_changes(
    pulses: tuple[PlannedPulse, ...], injection: PlannedPulse | None, spark: PlannedPulse | None,
    t_ns: i64,
) -> bool:  # fmt: skip
    """Whether nothing is new, told by identity, and nothing closes: most ticks."""
    seen_injection, seen_spark = injection is None, spark is None
    for pulse in pulses:
        if pulse.open_ns + pulse.duration_ns <= t_ns:
            return False
        if pulse is injection:
            seen_injection = True
        elif pulse is spark:
            seen_spark = True
    return seen_injection and seen_spark


def _command(machine: Machine, throttle: float, before: tuple[Message, ...]) -> MachineCommand:
    sent = before[1] if before else None
    if (
        isinstance(sent, MachineCommand) and sent.mode == machine.mode
        and sent.force_n == machine.force_n and sent.load_coefficient_n_s_m == machine.load_n_s_m
        and sent.throttle == throttle
    ):  # fmt: skip
        return sent
    return MachineCommand(machine.mode, machine.force_n, machine.load_n_s_m, throttle)


def messages(
    tick: i64, mode: Mode, machine: Machine, throttle: float, pulses: tuple[PlannedPulse, ...],
    before: tuple[Message, ...] = _NONE,
) -> tuple[Message, ...]:  # fmt: skip
    """The messages that answer a sample; an order that stands is the message sent `before`."""
    command = _command(machine, throttle, before)
    if not pulses:
        return (ControllerTick(tick, 2, int(mode)), command)
    sent = [
        Pulse(p.channel, wrap_us(p.open_ns), p.duration_ns // 1000) for p in pulses[:MAX_PULSES]
    ]
    return (ControllerTick(tick, 2 + len(sent), int(mode)), command, *sent)
