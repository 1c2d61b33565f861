"""Faults of a bus: each decides what becomes of the frames of a tick, and notes what it hurt."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from bench.bus.rig import Sent
from hil.wire.fields import layout_of
from hil.wire.messages import PistonSample, PlantTick

_SEED: Final = 20
_MS: Final = 1_000_000
FIRST_TICK: Final = 100
"""Before it the bus is good."""

GOOD_TICKS: Final = 500
"""At the end it is good again, so that what is missing shows in the counters that follow."""

NEEDED: Final = {layout_of(kind).can_id for kind in (PlantTick, PistonSample)}

Arrivals = Iterable[tuple[Sent, int]]
Hurt = Callable[["Injector", list[Sent], int], Arrivals]


class Injector:
    """A fault within its ticks, and what it has done: `done` by frame, `spoilt` ticks."""

    def __init__(self, hurt: Hurt, last: int) -> None:
        self.random = random.Random(_SEED)
        self.done: list[Sent] = []
        self.spoilt: set[int] = set()
        self.kept: dict[str, list[Sent]] = {}
        self._hurt = hurt
        self._last = last

    def apply(self, frames: list[Sent], tick: int) -> Arrivals:
        """Return what arrives of the frames of a tick, and when."""
        if not FIRST_TICK <= tick < self._last:
            self.kept[frames[0].sender] = frames
            return [(frame, 0) for frame in frames]
        return self._hurt(self, frames, tick)

    def note(self, frame: Sent) -> None:
        """Count a frame that was hurt."""
        self.done.append(frame)
        if frame.can_id in NEEDED:
            self.spoilt.add(frame.tick)


def loss(share: float) -> Hurt:
    """Lose this share of all frames."""

    def hurt(injector: Injector, frames: list[Sent], _tick: int) -> Iterator[tuple[Sent, int]]:
        for frame in frames:
            if injector.random.random() < share:
                injector.note(frame)
            else:
                yield frame, 0

    return hurt


def flips(injector: Injector, frames: list[Sent], _tick: int) -> Iterator[tuple[Sent, int]]:
    """Turn over one to three bits in one frame of a hundred."""
    for frame in frames:
        if injector.random.random() < 0.01:
            injector.note(frame)
            bits = injector.random.sample(range(64), injector.random.randint(1, 3))
            mask = sum(1 << bit for bit in bits)
            yield frame._replace(word=frame.word ^ mask), 0
        else:
            yield frame, 0


def duplicates(injector: Injector, frames: list[Sent], _tick: int) -> Iterator[tuple[Sent, int]]:
    """Send one frame of a hundred twice, the second time among or after the others."""
    for frame in frames:
        yield frame, 0
        if injector.random.random() < 0.01:
            injector.done.append(frame)
            yield frame, injector.random.choice((0, 60_000))


def reordering(injector: Injector, frames: list[Sent], _tick: int) -> Iterator[tuple[Sent, int]]:
    """Let one frame of a hundred come a tick late, after the next of its kind."""
    for frame in frames:
        if injector.random.random() < 0.01:
            injector.note(frame)
            yield frame, _MS + 100_000
        else:
            yield frame, 0


def spikes(length_ms: int) -> Hurt:
    """Hold everything up for so long, every 250 ms."""

    def hurt(injector: Injector, frames: list[Sent], tick: int) -> Iterator[tuple[Sent, int]]:
        phase = (tick - FIRST_TICK) % 250
        for frame in frames:
            if phase < length_ms:
                injector.note(frame)
                yield frame, (length_ms - phase) * _MS
            else:
                yield frame, 0

    return hurt


def bus_off(injector: Injector, frames: list[Sent], tick: int) -> Iterator[tuple[Sent, int]]:
    """Lose everything for 50 ms."""
    for frame in frames:
        if tick < FIRST_TICK + 50:
            injector.note(frame)
        else:
            yield frame, 0


def stuck(sender: str) -> Hurt:
    """For 50 ms put a sender in place of the real one that repeats the same old frames."""

    def hurt(injector: Injector, frames: list[Sent], tick: int) -> Iterator[tuple[Sent, int]]:
        if frames[0].sender != sender or tick >= FIRST_TICK + 50:
            yield from ((frame, 0) for frame in frames)
            return
        for frame in frames:
            if frame.can_id in NEEDED:
                injector.spoilt.add(tick)
        for frame in injector.kept[sender]:
            injector.done.append(frame)
            yield frame, 0

    return hurt
