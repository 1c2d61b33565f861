"""Frames of the plant, as straight code.

Generated from `hil/wire/messages.py` by `python -m bench.dev.generate`; do not edit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

from mypy_extensions import i64

from hil.rounding import SHIFT
from hil.wire.e2e import BYTE_7, PAIR_1_2, PAIR_3_4, PAIR_5_6, counter_marks
from hil.wire.fields import LAYOUTS
from hil.wire.messages import CylinderPeak, PistonSample, PlantTick, ValveMove
from hil.wire.stream import Stream, refuse

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
        raw: i64
        tick = message.tick
        if not 0 <= tick <= 4294967295:
            refuse(message, "tick")
        word |= tick << 12
        frame_count = message.frame_count
        if not 1 <= frame_count <= 7:
            refuse(message, "frame_count")
        word |= frame_count << 44
        slow = message.slow
        if not 0 <= slow <= 3:
            refuse(message, "slow")
        word |= slow << 47
        if slow == 0:
            electric_power_w = (message.electric_power_w / 1.0 + SHIFT) - SHIFT
            if not -16384.0 <= electric_power_w <= 16383.0:
                refuse(message, "electric_power_w")
            raw = int(electric_power_w)
            word |= raw << 49
        if slow == 1:
            p_left_pa = (message.p_left_pa / 1000.0 + SHIFT) - SHIFT
            if not 0.0 <= p_left_pa <= 32767.0:
                refuse(message, "p_left_pa")
            raw = int(p_left_pa)
            word |= ((raw ^ 16384) - 16384) << 49
        if slow == 2:
            p_right_pa = (message.p_right_pa / 1000.0 + SHIFT) - SHIFT
            if not 0.0 <= p_right_pa <= 32767.0:
                refuse(message, "p_right_pa")
            raw = int(p_right_pa)
            word |= ((raw ^ 16384) - 16384) << 49
        if slow == 3:
            winding_k = (message.winding_k / 0.02 + SHIFT) - SHIFT
            if not 0.0 <= winding_k <= 32767.0:
                refuse(message, "winding_k")
            raw = int(winding_k)
            word |= ((raw ^ 16384) - 16384) << 49
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
        slow = word >> 47 & 3
        electric_power_w = _NAN
        if slow == 0:
            electric_power_w_raw: int = (word >> 49 & 32767 ^ 16384) - 16384
            electric_power_w = electric_power_w_raw * 1.0
        p_left_pa = _NAN
        if slow == 1:
            p_left_pa_raw: int = word >> 49 & 32767
            p_left_pa = p_left_pa_raw * 1000.0
        p_right_pa = _NAN
        if slow == 2:
            p_right_pa_raw: int = word >> 49 & 32767
            p_right_pa = p_right_pa_raw * 1000.0
        winding_k = _NAN
        if slow == 3:
            winding_k_raw: int = word >> 49 & 32767
            winding_k = winding_k_raw * 0.02
        self.message = PlantTick(tick, frame_count, slow, electric_power_w, p_left_pa, p_right_pa, winding_k)
        return True


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
        raw: i64
        x_m = (message.x_m / 1e-08 + SHIFT) - SHIFT
        if not -8000000.0 <= x_m <= 8000000.0:
            refuse(message, "x_m")
        raw = int(x_m)
        word |= (raw & 16777215) << 12
        v_m_s = (message.v_m_s / 1e-06 + SHIFT) - SHIFT
        if not -8000000.0 <= v_m_s <= 8000000.0:
            refuse(message, "v_m_s")
        raw = int(v_m_s)
        word |= (raw & 16777215) << 36
        unheard = message.unheard
        if not 0 <= unheard <= 15:
            refuse(message, "unheard")
        word |= ((unheard ^ 8) - 8) << 60
        return word | PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        if (PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]) != word & 0xFFF:
            return False
        self.counter, self.bare, self.message = counter, word, None
        x_m_raw: int = (word >> 12 & 16777215 ^ 8388608) - 8388608
        if not -8000000 <= x_m_raw <= 8000000:
            return True
        x_m = x_m_raw * 1e-08
        v_m_s_raw: int = (word >> 36 & 16777215 ^ 8388608) - 8388608
        if not -8000000 <= v_m_s_raw <= 8000000:
            return True
        v_m_s = v_m_s_raw * 1e-06
        unheard = word >> 60 & 15
        self.message = PistonSample(x_m, v_m_s, unheard)
        return True


_VALVE_MOVE_MARKS: Final = counter_marks(LAYOUTS[0x102].data_ids)


@final
class ValveMoveStream(Stream[ValveMove]):
    """ValveMove on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x102, _VALVE_MOVE_MARKS)

    def pack(self, message: ValveMove) -> i64:
        """Return the bare word of a message."""
        word: i64 = 0
        channel = message.channel
        if not 0 <= channel <= 7:
            refuse(message, "channel")
        word |= channel << 12
        is_open = message.is_open
        if not 0 <= is_open <= 1:
            refuse(message, "is_open")
        word |= is_open << 16
        t_us = message.t_us
        if not 0 <= t_us <= 1048575:
            refuse(message, "t_us")
        word |= t_us << 17
        return word | PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        if (PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]) != word & 0xFFF:
            return False
        self.counter, self.bare, self.message = counter, word, None
        channel = word >> 12 & 15
        if not 0 <= channel <= 7:
            return True
        is_open = word >> 16 & 1
        t_us = word >> 17 & 1048575
        self.message = ValveMove(channel, is_open, t_us)
        return True


_CYLINDER_PEAK_MARKS: Final = counter_marks(LAYOUTS[0x103].data_ids)


@final
class CylinderPeakStream(Stream[CylinderPeak]):
    """CylinderPeak on its way in one direction."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(0x103, _CYLINDER_PEAK_MARKS)

    def pack(self, message: CylinderPeak) -> i64:
        """Return the bare word of a message."""
        word: i64 = 0
        raw: i64
        side = message.side
        if not 0 <= side <= 1:
            refuse(message, "side")
        word |= side << 12
        p_peak_pa = (message.p_peak_pa / 1000.0 + SHIFT) - SHIFT
        if not 0.0 <= p_peak_pa <= 32767.0:
            refuse(message, "p_peak_pa")
        raw = int(p_peak_pa)
        word |= raw << 13
        x_peak_m = (message.x_peak_m / 1e-06 + SHIFT) - SHIFT
        if not -80000.0 <= x_peak_m <= 80000.0:
            refuse(message, "x_peak_m")
        raw = int(x_peak_m)
        word |= (raw & 262143) << 28
        rise_pa_s = (message.rise_pa_s / 1000000.0 + SHIFT) - SHIFT
        if not 0.0 <= rise_pa_s <= 262143.0:
            refuse(message, "rise_pa_s")
        raw = int(rise_pa_s)
        word |= ((raw ^ 131072) - 131072) << 46
        return word | PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        if (PAIR_1_2[word >> 8 & 65535] ^ PAIR_3_4[word >> 24 & 65535] ^ PAIR_5_6[word >> 40 & 65535] ^ BYTE_7[word >> 56 & 255]) != word & 0xFFF:
            return False
        self.counter, self.bare, self.message = counter, word, None
        side = word >> 12 & 1
        p_peak_pa_raw: int = word >> 13 & 32767
        p_peak_pa = p_peak_pa_raw * 1000.0
        x_peak_m_raw: int = (word >> 28 & 262143 ^ 131072) - 131072
        if not -80000 <= x_peak_m_raw <= 80000:
            return True
        x_peak_m = x_peak_m_raw * 1e-06
        rise_pa_s_raw: int = word >> 46 & 262143
        rise_pa_s = rise_pa_s_raw * 1000000.0
        self.message = CylinderPeak(side, p_peak_pa, x_peak_m, rise_pa_s)
        return True


STREAMS: Final[dict[type, Callable[[], Stream[Any]]]] = {
    PlantTick: PlantTickStream,
    PistonSample: PistonSampleStream,
    ValveMove: ValveMoveStream,
    CylinderPeak: CylinderPeakStream,
}
