"""The recorders of both processes of a pair; one that has ended is joined again when it is back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from drivers.recorder.tap import Tap
from drivers.zenoh.sockets import Side
from hil.errors import LinkError

SIDES: Final[tuple[Side, ...]] = ("plant", "controller")


class Taps:
    """What both processes record, from when each is there.

    Parameters: place : where the recorder of a process can be joined
    """

    def __init__(self, place: Callable[[Side], Path]) -> None:
        self._place = place
        self._taps: dict[Side, Tap] = {}

    def join(self) -> dict[str, Tap]:
        """Join the processes that are there and not joined; returns those that are new."""
        new: dict[str, Tap] = {}
        for side in SIDES:
            tap = self._taps.get(side)
            if tap is not None and tap.ended:
                self._taps.pop(side).close()
            if side not in self._taps:
                try:
                    self._taps[side] = new[side] = Tap.join(self._place(side))
                except LinkError:
                    continue
        return new

    @property
    def present(self) -> set[str]:
        """The processes that are recorded at present."""
        return {side for side, tap in self._taps.items() if not tap.ended}

    @property
    def lost(self) -> int:
        """Bytes that this reader was too slow for."""
        return sum(tap.lost for tap in self._taps.values())

    def take(self) -> Iterator[tuple[str, Tap, bytes]]:
        """Yield side, tap and whole Message records of each process that has recorded some."""
        for side, tap in self._taps.items():
            data = tap.read()
            if data:
                yield side, tap, data

    def close(self) -> None:
        """Leave both recorders."""
        for tap in self._taps.values():
            tap.close()
        self._taps.clear()
