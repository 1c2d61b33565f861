"""DAQ lists: what a master wants to have of every tick, and the packets that bring it."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.live.xcp.addresses import Place

EVENTS: Final = ("plant", "controller")
"""Event channels by number: a tick of each process."""

_STAMP: Final = struct.Struct("<I")
Rows = Mapping[str, NDArray[Any]]


def cycle_of(period_us: int) -> tuple[int, int]:
    """Return a period as a number of at most 255 and the unit it counts in: 1 us, 10 us ..."""
    unit = 3
    while period_us > 255:
        period_us, unit = round(period_us / 10), unit + 1
    return period_us, unit


class DaqList:
    """One list: its object tables with their entries, and the event that sends them."""

    def __init__(self) -> None:
        self.tables: list[list[Place | None]] = []
        self.event = 0
        self.stamped = True
        self.selected = self.running = False
        self.first_pid = 0
        self._held: dict[int, float] = {}

    def packets(self, rows: Rows) -> Iterator[bytes]:
        """Yield the packets of all ticks in a batch of records, tick by tick."""
        timing = rows.get("/timing")
        if timing is None or not self.running:
            return
        ticks, stamps = timing["tick"], timing["t_ns"] // 1000 & 0xFFFFFFFF
        columns = [
            [self._column(place, rows, ticks) for place in table if place is not None]
            for table in self.tables
        ]
        for row, stamp in enumerate(stamps.tolist()):
            for number, table in enumerate(columns):
                head = bytes([self.first_pid + number])
                if self.stamped and number == 0:
                    head += _STAMP.pack(stamp)
                yield head + b"".join(column[row] for column in table)

    def _column(self, place: Place, rows: Rows, ticks: NDArray[Any]) -> list[bytes]:
        """Bytes of a value in each tick; of what is not put every tick the last one holds."""
        signal = place.signal
        assert signal is not None
        held = self._held.get(place.address, 0.0)
        found = rows.get(signal.topic)
        values = np.full(len(ticks), held)
        if found is not None and len(found):
            column = found[signal.field]
            own = column if signal.item is None else column[:, signal.item]
            if len(own) == len(ticks) and np.array_equal(found["tick"], ticks):
                values = own
            else:
                at = np.searchsorted(found["tick"], ticks, side="right") - 1
                values = np.where(at >= 0, own[np.maximum(at, 0)], held)
        self._held[place.address] = values[-1].item()
        sign = "f" if place.code in "fd" else "i" if place.code.islower() else "u"
        kind = np.dtype(f"<{sign}{place.size}")
        raw = np.ascontiguousarray(values).astype(kind).tobytes()
        return [raw[i : i + place.size] for i in range(0, len(raw), place.size)]
