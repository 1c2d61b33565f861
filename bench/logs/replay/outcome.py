"""What a replay comes to."""

from __future__ import annotations

from typing import NamedTuple

from bench.logs.replay.differences import Difference


class Gap(NamedTuple):
    """Ticks that are not in the log, and where the replay went on, -1 when it could not."""

    first_tick: int
    next_tick: int


class Found(NamedTuple):
    """The first turn that differs, and what was recorded and replayed around it."""

    tick: int
    differences: tuple[Difference, ...]
    around: tuple[tuple[bytes, bytes], ...]


class Outcome(NamedTuple):
    """What a replay came to."""

    process: str
    first_tick: int
    ticks: int
    different: int
    found: Found | None
    gaps: tuple[Gap, ...]
    notes: tuple[str, ...]
    simulated_s: float
    cpu_s: float

    @property
    def identical(self) -> bool:
        """Whether every turn that could be replayed put what was put then."""
        return self.found is None
