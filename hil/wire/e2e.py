"""AUTOSAR E2E profile 2: CRC-8 (0x2F) and a 4-bit counter in every frame.

The CRC covers bytes 1 to 7 of the frame and one data identifier chosen by the counter. It is
linear, so the table of two bytes is the exclusive or of two tables of one byte, and a frame costs
four look-ups instead of eight.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from mypy_extensions import i64

_POLYNOMIAL: Final = 0x2F
_INITIAL: Final = 0xFF
_FINAL_XOR: Final = 0xFF
_WORDS: Final = 1 << 64
_COVERED_BYTES: Final = 8  # seven of the frame and the data identifier

COUNTER_MODULO: Final = 16
MAX_DELTA: Final = 11
"""Counter steps 2 to 11 are losses, more than a stale sample waits for; 12 to 15 are frames older
than the last one: reordered."""


def _crc_step(crc: int) -> int:
    """Shift eight zero bits through the polynomial."""
    for _ in range(8):
        crc = (crc << 1) ^ _POLYNOMIAL if crc & 0x80 else crc << 1
        crc &= 0xFF
    return crc


def _byte_tables() -> list[bytes]:
    """The contribution of each value of each covered byte, by its position from the front."""
    table = bytes(_crc_step(value) for value in range(256))
    tables = [table]
    for _ in range(_COVERED_BYTES - 1):
        tables.append(tables[-1].translate(table))
    return tables[::-1]


def _pair_table(low: bytes, high: bytes) -> bytes:
    """Table of two adjacent bytes of a little-endian word."""
    low_word = int.from_bytes(low, "little")
    return b"".join(
        (low_word ^ int.from_bytes(bytes([value]) * 256, "little")).to_bytes(256, "little")
        for value in high
    )


def _constant() -> int:
    """What the initial value contributes after all covered bytes, with the final inversion."""
    crc = _INITIAL
    for _ in range(_COVERED_BYTES):
        crc = _crc_step(crc)
    return crc ^ _FINAL_XOR


_BYTES: Final = _byte_tables()
PAIR_1_2: Final = _pair_table(_BYTES[0], _BYTES[1])
PAIR_3_4: Final = _pair_table(_BYTES[2], _BYTES[3])
PAIR_5_6: Final = _pair_table(_BYTES[4], _BYTES[5])
BYTE_7: Final = _BYTES[6]
_START: Final = _constant()


def signed(word: int) -> int:
    """Return the 64 bits of a word as the number in two's complement that machine code has."""
    return word - _WORDS if word >> 63 else word


def unsigned(word: int) -> int:
    """Return the 64 bits of a word as a number from nought."""
    return word & _WORDS - 1


def crc8(word: i64) -> i64:
    """What bits 8 to 63 of a signed word contribute to its CRC."""
    return (
        PAIR_1_2[word >> 8 & 0xFFFF] ^ PAIR_3_4[word >> 24 & 0xFFFF]
        ^ PAIR_5_6[word >> 40 & 0xFFFF] ^ BYTE_7[word >> 56 & 0xFF]
    )  # fmt: skip


def crc_of(word: int) -> int:
    """What bits 8 to 63 of a word contribute to its CRC."""
    return crc8(signed(word))


def counter_marks(data_ids: bytes) -> tuple[int, ...]:
    """What each counter value adds to a word, by exclusive or: its four bits and its share of CRC.

    The share holds the start value and the data identifier, the last covered byte. A word of
    payload and `crc_of(payload)` becomes a frame by one mark; the same mark takes it off again,
    so that a frame that repeats a payload costs neither a CRC nor a decoding.

    Parameters: data_ids : the 16 data identifiers of a message
    Returns: tuple, shape (16,)
    """
    return tuple(
        counter << 8 | (_START ^ _BYTES[7][data_id] ^ crc_of(counter << 8))
        for counter, data_id in enumerate(data_ids)
    )


def protect(payload: int, counter: int, marks: tuple[int, ...]) -> int:
    """Complete a frame's word from its payload (bits 12 to 63) and counter."""
    return (payload | crc_of(payload)) ^ marks[counter]


def is_intact(word: int, marks: tuple[int, ...]) -> bool:
    """Whether the CRC of a received word is right."""
    bare = word ^ marks[word >> 8 & 0xF]
    return crc_of(bare) == bare & 0xFF


class ReceptionCounts(NamedTuple):
    """What a receiver saw, by verdict; every frame is counted once.

    `lost` counts frames that a counter step shows as missing, not frames received; `incomplete`
    counts batches that ended within a frame.
    """

    ok: int = 0
    corrupted: int = 0
    repeated: int = 0
    reordered: int = 0
    lost: int = 0
    out_of_range: int = 0
    unknown: int = 0
    incomplete: int = 0
