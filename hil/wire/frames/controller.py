"""Frames of the controller, as straight code.

Generated from `hil/wire/messages.py` by `python -m bench.dev.generate`; do not edit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

from mypy_extensions import i64

from hil.wire.e2e import counter_marks, crc8
from hil.wire.fields import LAYOUTS
from hil.wire.messages import ControllerTick, MachineCommand, Pulse
from hil.wire.stream import ROUND, Stream, refuse

_NAN: Final = float("nan")


_CONTROLLER_TICK_MARKS: Final = counter_marks(LAYOUTS[0x200].data_ids)


@final
class ControllerTickStream(Stream[ControllerTick]):
    """ControllerTick on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x200, _CONTROLLER_TICK_MARKS)

    def pack(self, message: ControllerTick) -> i64:
        """Return the bare word of a message."""
        word: i64 = 0
        tick = message.tick
        if not 0 <= tick <= 4294967295:
            refuse(message, "tick")
        word |= tick << 12
        frame_count = message.frame_count
        if not 1 <= frame_count <= 7:
            refuse(message, "frame_count")
        word |= frame_count << 44
        mode = message.mode
        if not 0 <= mode <= 4:
            refuse(message, "mode")
        word |= mode << 47
        return word | crc8(word)

    def unpack(self, word: i64) -> ControllerTick | None:
        """Return the message of a bare word, None when a value is out of range."""
        raw = word >> 12 & 4294967295
        tick = raw
        raw = word >> 44 & 7
        if not 1 <= raw <= 7:
            return None
        frame_count = raw
        raw = word >> 47 & 7
        if not 0 <= raw <= 4:
            return None
        mode = raw
        return ControllerTick(tick, frame_count, mode)


_MACHINE_COMMAND_MARKS: Final = counter_marks(LAYOUTS[0x201].data_ids)


@final
class MachineCommandStream(Stream[MachineCommand]):
    """MachineCommand on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x201, _MACHINE_COMMAND_MARKS)

    def pack(self, message: MachineCommand) -> i64:
        """Return the bare word of a message."""
        word: i64 = 0
        mode = message.mode
        if not 0 <= mode <= 2:
            refuse(message, "mode")
        word |= mode << 12
        force_n = (message.force_n / 0.01 + ROUND) - ROUND
        if not -500000.0 <= force_n <= 500000.0:
            refuse(message, "force_n")
        word |= (int(force_n) & 1048575) << 14
        load_coefficient_n_s_m = (message.load_coefficient_n_s_m / 0.01 + ROUND) - ROUND
        if not 0.0 <= load_coefficient_n_s_m <= 1000000.0:
            refuse(message, "load_coefficient_n_s_m")
        word |= int(load_coefficient_n_s_m) << 34
        throttle = (message.throttle / 0.004 + ROUND) - ROUND
        if not 0.0 <= throttle <= 250.0:
            refuse(message, "throttle")
        word |= int(throttle) << 54
        return word | crc8(word)

    def unpack(self, word: i64) -> MachineCommand | None:
        """Return the message of a bare word, None when a value is out of range."""
        raw = word >> 12 & 3
        if not 0 <= raw <= 2:
            return None
        mode = raw
        raw = (word >> 14 & 1048575 ^ 524288) - 524288
        if not -500000 <= raw <= 500000:
            return None
        force_n = float(raw) * 0.01
        raw = word >> 34 & 1048575
        if not 0 <= raw <= 1000000:
            return None
        load_coefficient_n_s_m = float(raw) * 0.01
        raw = word >> 54 & 255
        if not 0 <= raw <= 250:
            return None
        throttle = float(raw) * 0.004
        return MachineCommand(mode, force_n, load_coefficient_n_s_m, throttle)


_PULSE_MARKS: Final = counter_marks(LAYOUTS[0x202].data_ids)


@final
class PulseStream(Stream[Pulse]):
    """Pulse on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x202, _PULSE_MARKS)

    def pack(self, message: Pulse) -> i64:
        """Return the bare word of a message."""
        word: i64 = 0
        channel = message.channel
        if not 0 <= channel <= 7:
            refuse(message, "channel")
        word |= channel << 12
        open_us = message.open_us
        if not 0 <= open_us <= 1048575:
            refuse(message, "open_us")
        word |= open_us << 16
        duration_us = message.duration_us
        if not 1 <= duration_us <= 65535:
            refuse(message, "duration_us")
        word |= duration_us << 36
        return word | crc8(word)

    def unpack(self, word: i64) -> Pulse | None:
        """Return the message of a bare word, None when a value is out of range."""
        raw = word >> 12 & 15
        if not 0 <= raw <= 7:
            return None
        channel = raw
        raw = word >> 16 & 1048575
        open_us = raw
        raw = word >> 36 & 65535
        if not 1 <= raw <= 65535:
            return None
        duration_us = raw
        return Pulse(channel, open_us, duration_us)


STREAMS: Final[dict[type, Callable[[], Stream[Any]]]] = {
    ControllerTick: ControllerTickStream,
    MachineCommand: MachineCommandStream,
    Pulse: PulseStream,
}
