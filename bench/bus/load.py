"""How full the bus was in a run: every frame of its logs, bit by bit, in numpy blocks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil import log as logs
from hil.log import Log

_BLOCK = 8192
_STUFFED_BITS = 98  # start of frame to the end of the CRC, for a standard frame of 8 bytes
_TAIL_BITS = 13
_CRC15 = 0x4599

Ints = NDArray[np.int64]


class BusLoad(NamedTuple):
    """Bits of all ticks of a run."""

    ticks: int
    frames: int
    mean_bits: float
    most_bits: int

    def shares(self, rate_hz: float, bitrate_bit_s: float) -> tuple[float, float]:
        """Return the share of the bus in the mean and in the fullest tick."""
        per_bit = rate_hz / bitrate_bit_s
        return self.mean_bits * per_bit, self.most_bits * per_bit


def frame_bits(ids: Ints, words: NDArray[np.uint64]) -> Ints:
    """Return the bits of standard frames of 8 bytes with stuffing and gap, shape (frames,).

    Parameters: ids, words : shape (frames,), the words little-endian
    """
    count = len(ids)
    bits = np.zeros((count, _STUFFED_BITS), dtype=np.uint8)
    head = ids.astype(np.uint64) << np.uint64(7) | np.uint64(8)  # RTR, IDE, r0 = 0; length 8
    for place in range(18):
        bits[:, 1 + place] = head >> np.uint64(17 - place) & np.uint64(1)
    data = words.astype("<u8").reshape(count, 1).view(np.uint8)
    bits[:, 19:83] = np.unpackbits(data, axis=1)
    crc = np.zeros(count, dtype=np.int64)
    for place in range(83):
        top = (crc >> 14 ^ bits[:, place]) & 1
        crc = (crc << 1 ^ top * _CRC15) & 0x7FFF
    for place in range(15):
        bits[:, 83 + place] = crc >> (14 - place) & 1
    return _STUFFED_BITS + _TAIL_BITS + _stuffed(bits)


def _stuffed(bits: NDArray[np.uint8]) -> Ints:
    """Count the stuff bits of every row."""
    run = np.zeros(len(bits), dtype=np.int64)
    last = np.full(len(bits), 2, dtype=np.uint8)
    total = np.zeros(len(bits), dtype=np.int64)
    for column in bits.T:
        run = np.where(column == last, run + 1, 1)
        full = run == 5
        total += full
        last = np.where(full, 1 - column, column).astype(np.uint8)
        run = np.where(full, 1, run)
    return total


def load_of(plant: Log, controller: Log) -> BusLoad:
    """Return how full the ticks of a run were, both directions together."""
    bits = np.zeros(0, dtype=np.int64)
    frames = 0
    for log in (plant, controller):
        for ticks, ids, words in _blocks(log):
            frames += len(ids)
            needed = int(ticks.max()) + 1
            if needed > len(bits):
                bits = np.concatenate([bits, np.zeros(needed - len(bits), dtype=np.int64)])
            bits += np.bincount(ticks, frame_bits(ids, words), len(bits)).astype(np.int64)
    if not frames:
        return BusLoad(0, 0, 0.0, 0)
    return BusLoad(len(bits), frames, float(bits.mean()), int(bits.max()))


def _blocks(log: Log) -> Iterator[tuple[Ints, Ints, NDArray[np.uint64]]]:
    """Yield ticks, identifiers and words of the frames that a process sent."""
    ticks: list[int] = []
    parts: list[bytes] = []
    for tick, _, batch in log.frames("sent"):
        ticks += [tick] * (len(batch) // 10)
        parts.append(batch)
        if len(ticks) >= _BLOCK:
            yield _arrays(ticks, parts)
            ticks, parts = [], []
    if ticks:
        yield _arrays(ticks, parts)


def _arrays(ticks: list[int], parts: list[bytes]) -> tuple[Ints, Ints, NDArray[np.uint64]]:
    frames = np.frombuffer(b"".join(parts), dtype=np.dtype([("id", "<u2"), ("word", "<u8")]))
    ids = frames["id"].astype(np.int64)
    return np.array(ticks, dtype=np.int64), ids, frames["word"].astype(np.uint64)


def of_logs(plant: str, controller: str) -> BusLoad:
    """Return the load of two log files.

    Raises: LogError
    """
    with logs.open(plant) as one, logs.open(controller) as other:
        return load_of(one, other)
