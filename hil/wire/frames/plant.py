"""Frames of the plant, as straight code.

Generated from `hil/wire/messages.py` by `python -m bench.dev.generate`; do not edit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

from mypy_extensions import i64

from hil.wire.e2e import counter_marks, crc8
from hil.wire.fields import LAYOUTS
from hil.wire.messages import PistonSample, PlantTick
from hil.wire.stream import ROUND, Stream, refuse

_NAN: Final = float("nan")


_PLANT_TICK_MARKS: Final = counter_marks(LAYOUTS[0x100].data_ids)


@final
class PlantTickStream(Stream[PlantTick]):
    """PlantTick on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x100, _PLANT_TICK_MARKS)

    def pack(self, message: PlantTick) -> i64:
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
        slow = message.slow
        if not 0 <= slow <= 2:
            refuse(message, "slow")
        word |= slow << 47
        if slow == 0:
            electric_power_w = (message.electric_power_w / 1.0 + ROUND) - ROUND
            if not -16384.0 <= electric_power_w <= 16383.0:
                refuse(message, "electric_power_w")
            word |= int(electric_power_w) << 49
        if slow == 1:
            p_left_pa = (message.p_left_pa / 1000.0 + ROUND) - ROUND
            if not 0.0 <= p_left_pa <= 32767.0:
                refuse(message, "p_left_pa")
            word |= ((int(p_left_pa) ^ 16384) - 16384) << 49
        if slow == 2:
            p_right_pa = (message.p_right_pa / 1000.0 + ROUND) - ROUND
            if not 0.0 <= p_right_pa <= 32767.0:
                refuse(message, "p_right_pa")
            word |= ((int(p_right_pa) ^ 16384) - 16384) << 49
        return word | crc8(word)

    def unpack(self, word: i64) -> PlantTick | None:
        """Return the message of a bare word, None when a value is out of range."""
        raw = word >> 12 & 4294967295
        tick = raw
        raw = word >> 44 & 7
        if not 1 <= raw <= 7:
            return None
        frame_count = raw
        raw = word >> 47 & 3
        if not 0 <= raw <= 2:
            return None
        slow = raw
        electric_power_w = _NAN
        if slow == 0:
            raw = (word >> 49 & 32767 ^ 16384) - 16384
            electric_power_w = float(raw) * 1.0
        p_left_pa = _NAN
        if slow == 1:
            raw = word >> 49 & 32767
            p_left_pa = float(raw) * 1000.0
        p_right_pa = _NAN
        if slow == 2:
            raw = word >> 49 & 32767
            p_right_pa = float(raw) * 1000.0
        return PlantTick(tick, frame_count, slow, electric_power_w, p_left_pa, p_right_pa)


_PISTON_SAMPLE_MARKS: Final = counter_marks(LAYOUTS[0x101].data_ids)


@final
class PistonSampleStream(Stream[PistonSample]):
    """PistonSample on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x101, _PISTON_SAMPLE_MARKS)

    def pack(self, message: PistonSample) -> i64:
        """Return the bare word of a message."""
        word: i64 = 0
        x_m = (message.x_m / 1e-08 + ROUND) - ROUND
        if not -8000000.0 <= x_m <= 8000000.0:
            refuse(message, "x_m")
        word |= (int(x_m) & 16777215) << 12
        v_m_s = (message.v_m_s / 1e-06 + ROUND) - ROUND
        if not -8000000.0 <= v_m_s <= 8000000.0:
            refuse(message, "v_m_s")
        word |= (int(v_m_s) & 16777215) << 36
        unheard = message.unheard
        if not 0 <= unheard <= 15:
            refuse(message, "unheard")
        word |= ((unheard ^ 8) - 8) << 60
        return word | crc8(word)

    def unpack(self, word: i64) -> PistonSample | None:
        """Return the message of a bare word, None when a value is out of range."""
        raw = (word >> 12 & 16777215 ^ 8388608) - 8388608
        if not -8000000 <= raw <= 8000000:
            return None
        x_m = float(raw) * 1e-08
        raw = (word >> 36 & 16777215 ^ 8388608) - 8388608
        if not -8000000 <= raw <= 8000000:
            return None
        v_m_s = float(raw) * 1e-06
        raw = word >> 60 & 15
        unheard = raw
        return PistonSample(x_m, v_m_s, unheard)


STREAMS: Final[dict[type, Callable[[], Stream[Any]]]] = {
    PlantTick: PlantTickStream,
    PistonSample: PistonSampleStream,
}
