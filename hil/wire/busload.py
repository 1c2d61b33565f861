"""How long frames take on a CAN bus: bit by bit with stuffing, and at worst for a whole tick.

ISO 11898-1: after five equal bits a sixth, opposite one is stuffed in, from the start of frame to
the end of the CRC; the delimiters, the acknowledge, the end of frame and the gap of three bits
before the next frame are never stuffed.
"""

from __future__ import annotations

from typing import Final

import hil.wire.messages
from hil.errors import ConfigError
from hil.wire.fields import LAYOUTS

BITS_MIN: Final = 111
BITS_MAX: Final = 135
"""A classic standard frame of 8 bytes with its gap: without, and with the most stuff bits."""

FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Bytes of an FD frame by its data length code."""

_TAIL_BITS: Final = 13  # CRC delimiter 1, acknowledge 2, end of frame 7, gap 3
_CRC15: Final = 0x4599
_DECLARED: Final = len(hil.wire.messages.Message.__args__)


def frames_per_tick() -> int:
    """Return the most frames of one tick, both directions together."""
    assert len(LAYOUTS) == _DECLARED
    return sum(layout.per_tick for layout in LAYOUTS.values())


def worst_load(rate_hz: float, bitrate_bit_s: float) -> float:
    """Return the share of the bus that the loop takes when every frame is stuffed the most.

    n 135 bit f / r, with n frames a tick
    """
    return frames_per_tick() * BITS_MAX * rate_hz / bitrate_bit_s


def check_fit(rate_hz: int, bitrate_bit_s: int) -> None:
    """Refuse a loop rate that the bus cannot carry.

    Raises: ConfigError with the highest rate that it can
    """
    load = worst_load(rate_hz, bitrate_bit_s)
    if load > 1.0:
        most = int(rate_hz / load)
        raise ConfigError(
            f"loop.rate_hz = {rate_hz}: {frames_per_tick()} frames a tick take {load:.0%} of a bus"
            f" of {bitrate_bit_s} bit/s; accepted up to {most} Hz (link.bitrate_bit_s)"
        )


def classic_bits(can_id: int, data: bytes, *, extended: bool = False, remote: int = -1) -> int:
    """Return the bits of a classic frame on the wire, stuff bits and gap included.

    Parameters: data : at most 8 bytes; remote : data length code of a remote frame, -1 for data
    """
    code = len(data) if remote < 0 else remote
    bits, width = _head(can_id, extended, remote >= 0)
    bits, width = bits << 4 | code, width + 4
    if remote < 0:
        bits, width = bits << 8 * len(data) | int.from_bytes(data, "big"), width + 8 * len(data)
    bits, width = bits << 15 | _crc15(bits, width), width + 15
    return width + stuff_bits(bits, width) + _TAIL_BITS


def _head(can_id: int, extended: bool, remote: bool) -> tuple[int, int]:
    """Start of frame to the reserved bits: (bits, width)."""
    if not extended:
        return (can_id & 0x7FF) << 3 | remote << 2, 15
    base, more = can_id >> 18 & 0x7FF, can_id & 0x3FFFF
    return (base << 2 | 0b11) << 21 | more << 3 | remote << 2, 35


def fd_bits(can_id: int, length: int, data: bytes, *, extended: bool = False) -> tuple[int, int]:
    """Return the bits of an FD frame as (at the nominal rate, at the data rate).

    Up to the data stuffing is as in classic frames; the CRC has its own fixed stuff bits.
    """
    bits, width = _head(can_id, extended, remote=False)
    bits, width = bits << 3 | 0b101, width + 3  # FDF, reserved and BRS, roughly where they are
    nominal = width + stuff_bits(bits, width)
    payload = data + bytes(length - len(data))
    code = FD_LENGTHS.index(length)
    inner = code << 8 * length | int.from_bytes(payload, "big")
    inner_width = 5 + 8 * length
    crc = 17 if length <= 16 else 21
    fixed = 1 + (crc + 4 + 3) // 4
    return nominal + _TAIL_BITS, inner_width + stuff_bits(inner, inner_width) + 4 + crc + fixed


def _crc15(bits: int, width: int) -> int:
    """CRC-15 of classic CAN over that many bits."""
    crc = 0
    for place in range(width - 1, -1, -1):
        crc = (crc << 1) ^ (_CRC15 if (crc >> 14 ^ bits >> place) & 1 else 0)
        crc &= 0x7FFF
    return crc


def stuff_bits(bits: int, width: int) -> int:
    """Return how many bits are stuffed into that many bits, of which the highest is sent first."""
    stuffed, run, last = 0, 0, -1
    for place in range(width - 1, -1, -1):
        bit = bits >> place & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, run, last = stuffed + 1, 1, 1 - bit
    return stuffed
