"""Frames of the controller, as straight code.

Generated from `hil/wire/messages.py` by `python -m bench.dev.generate`; do not edit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

from mypy_extensions import i64

from hil.rounding import SHIFT
from hil.wire.e2e import BYTE_7, PAIR_1_2, PAIR_3_4, PAIR_5_6, counter_marks
from hil.wire.fields import LAYOUTS
from hil.wire.messages import ControllerTick, MachineCommand, Pulse
from hil.wire.stream import Stream, refuse

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
        return word | PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        if (PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]) != word & 0xFFF:
            return False
        self.counter, self.bare, self.message = counter, word, None
        tick = word >> 12 & 4294967295
        frame_count = word >> 44 & 7
        if not 1 <= frame_count <= 7:
            return True
        mode = word >> 47 & 7
        if not 0 <= mode <= 4:
            return True
        self.message = ControllerTick(tick, frame_count, mode)
        return True


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
        raw: i64
        mode = message.mode
        if not 0 <= mode <= 2:
            refuse(message, "mode")
        word |= mode << 12
        force_n = (message.force_n / 0.01 + SHIFT) - SHIFT
        if not -500000.0 <= force_n <= 500000.0:
            refuse(message, "force_n")
        raw = int(force_n)
        word |= (raw & 1048575) << 14
        load_coefficient_n_s_m = (message.load_coefficient_n_s_m / 0.01 + SHIFT) - SHIFT
        if not 0.0 <= load_coefficient_n_s_m <= 1000000.0:
            refuse(message, "load_coefficient_n_s_m")
        raw = int(load_coefficient_n_s_m)
        word |= raw << 34
        throttle = (message.throttle / 0.004 + SHIFT) - SHIFT
        if not 0.0 <= throttle <= 250.0:
            refuse(message, "throttle")
        raw = int(throttle)
        word |= raw << 54
        return word | PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        if (PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]) != word & 0xFFF:
            return False
        self.counter, self.bare, self.message = counter, word, None
        mode = word >> 12 & 3
        if not 0 <= mode <= 2:
            return True
        force_n_raw: int = (word >> 14 & 1048575 ^ 524288) - 524288
        if not -500000 <= force_n_raw <= 500000:
            return True
        force_n = force_n_raw * 0.01
        load_coefficient_n_s_m_raw: int = word >> 34 & 1048575
        if not 0 <= load_coefficient_n_s_m_raw <= 1000000:
            return True
        load_coefficient_n_s_m = load_coefficient_n_s_m_raw * 0.01
        throttle_raw: int = word >> 54 & 255
        if not 0 <= throttle_raw <= 250:
            return True
        throttle = throttle_raw * 0.004
        self.message = MachineCommand(mode, force_n, load_coefficient_n_s_m, throttle)
        return True


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
        if not 1 <= duration_us <= 1048575:
            refuse(message, "duration_us")
        word |= duration_us << 36
        return word | PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        if (PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]) != word & 0xFFF:
            return False
        self.counter, self.bare, self.message = counter, word, None
        channel = word >> 12 & 15
        if not 0 <= channel <= 7:
            return True
        open_us = word >> 16 & 1048575
        duration_us = word >> 36 & 1048575
        if not 1 <= duration_us <= 1048575:
            return True
        self.message = Pulse(channel, open_us, duration_us)
        return True


STREAMS: Final[dict[type, Callable[[], Stream[Any]]]] = {
    ControllerTick: ControllerTickStream,
    MachineCommand: MachineCommandStream,
    Pulse: PulseStream,
}
