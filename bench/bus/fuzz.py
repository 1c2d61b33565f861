"""Frames at random and frames changed at random, fed to the decoders of both processes.

hil bus fuzz [--frames N]
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Iterator
from typing import Final, NamedTuple

from bench.measure.codec_cost import tick_messages
from hil.wire.codec import Decoder, Encoder, iter_frames, pack_frame
from hil.wire.e2e import counter_marks, is_intact
from hil.wire.fields import LAYOUTS, Layout

THEORY: Final = 1 / 256
_BATCH: Final = 10
_IDS: Final = (*LAYOUTS, 0x000, 0x102, 0x203, 0x7FF)


class Fuzzed(NamedTuple):
    """What became of the frames of one kind: how many, and how many came through each gate."""

    kind: str
    frames: int
    own: int
    passed_crc: int
    acted_on: int
    seconds: float

    @property
    def share(self) -> float:
        """Frames with a known identifier that passed the CRC."""
        return self.passed_crc / self.own if self.own else 0.0


def random_frames(source: random.Random) -> Iterator[tuple[int, int]]:
    """Yield frames of which nothing is known but that most have an identifier of ours."""
    while True:
        yield source.choice(_IDS), source.getrandbits(64)


def mutated_frames(source: random.Random) -> Iterator[tuple[int, int]]:
    """Yield a run's frames, each cut up, turned over, delayed, or put under another identifier."""
    encoder, tick = Encoder(), 0
    old: list[tuple[int, int]] = [(0x100, 0)]
    while True:
        tick += 1
        for side in tick_messages(tick, fresh=True):
            for frame in iter_frames(encoder.encode(side)):
                yield _mutated(source, frame, source.choice(old))
                old = [*old[-31:], frame]


def _mutated(
    source: random.Random, frame: tuple[int, int], other: tuple[int, int]
) -> tuple[int, int]:
    can_id, word = frame
    kind = source.randrange(5)
    if kind == 0:
        for _ in range(source.randint(1, 12)):
            word ^= 1 << source.randrange(64)
    elif kind == 1:
        word = word & 0xFFFFFFFF | other[1] & ~0xFFFFFFFF
    elif kind == 2:
        can_id, word = other
    elif kind == 3:
        can_id = source.choice(_IDS)
    else:
        word = source.choice((0, 2**64 - 1, word << 8 & 2**64 - 1, word >> 8))
    return can_id, word


def fuzz(kind: str, frames: int, seed: int = 1) -> Fuzzed:
    """Feed both decoders; what they accept is held against the layouts once more.

    Raises: AssertionError when a frame was acted on that fails protection or range
    """
    source = random.Random(seed)
    stream = random_frames(source) if kind == "random" else mutated_frames(source)
    decoders = (Decoder("plant"), Decoder("controller"))
    checks = {can_id: counter_marks(layout.data_ids) for can_id, layout in LAYOUTS.items()}
    own = passed = acted = 0
    start_s = time.perf_counter()
    for _ in range(frames // _BATCH):
        batch = [next(stream) for _ in range(_BATCH)]
        intact = sum(1 for i, word in batch if i in checks and is_intact(word, checks[i]))
        own += sum(1 for i, _ in batch if i in checks)
        passed += intact
        data = b"".join(pack_frame(can_id, word) for can_id, word in batch)
        accepted = [message for decoder in decoders for message in decoder.decode(data)]
        assert len(accepted) <= intact, "a frame with a wrong CRC was accepted"
        for message in accepted:
            check_range(message)
        acted += len(accepted)
    return Fuzzed(kind, frames, own, passed, acted, time.perf_counter() - start_s)


def check_range(message: object) -> None:
    """Hold a message against its declaration.

    Raises: AssertionError when a value is outside of its range
    """
    layout: Layout = next(x for x in LAYOUTS.values() if x.make is type(message))
    for placed in layout.fields:
        value = getattr(message, placed.name)
        if math.isnan(value):
            assert placed.signal.only_when is not None
            continue
        low, high = placed.signal.raw_range
        assert low <= round(value / placed.signal.scale) <= high, (layout.name, placed.name)


def report(frames: int, seed: int) -> list[Fuzzed]:
    """Fuzz with both kinds of frames and print what came of it."""
    found = [fuzz(kind, frames // 2, seed) for kind in ("random", "mutated")]
    for one in found:
        print(
            f"{one.kind:<8} {one.frames} frames in {one.seconds:.1f} s: {one.passed_crc} of"
            f" {one.own} with an identifier of ours pass the CRC (1/{1 / (one.share or 1):.1f}),"
            f" {one.acted_on} pass counter and range too"
        )
    print(f"theory: a random frame passes an 8-bit CRC with 1/{1 / THEORY:.0f}")
    return found
