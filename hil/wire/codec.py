"""SI values to frames and back, protected end to end.

The frames of one tick are one `bytes` object, a batch: ten bytes a frame, the CAN identifier
(u16) and the eight data bytes as one little-endian word. Every link and the log carry it as is.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple, final

from librt.strings import (
    BytesWriter,
    read_i16_le,
    read_i64_le,
    write_i16_le,
    write_i64_le,
)
from mypy_extensions import i64

from hil.errors import CodecError
from hil.wire.e2e import MAX_DELTA, ReceptionCounts, crc8, signed, unsigned
from hil.wire.fields import LAYOUTS
from hil.wire.frames import controller, plant
from hil.wire.messages import Message
from hil.wire.stream import Stream

FRAME: Final = struct.Struct("<HQ")
"""One frame of a batch: CAN identifier and data word."""

FRAME_SIZE: Final = 10

pack_frame: Final = FRAME.pack
iter_frames: Final = FRAME.iter_unpack


_SENDERS: Final = {"plant": plant.STREAMS, "controller": controller.STREAMS}


def frames_of(batch: bytes) -> Iterator[tuple[int, int]]:
    """Iterate over (can_id, word) of a batch.

    Raises: CodecError when the batch is not a whole number of frames
    """
    try:
        return FRAME.iter_unpack(batch)
    except struct.error:
        raise CodecError(
            f"a batch of {len(batch)} bytes is not a multiple of {FRAME.size}"
        ) from None


@final
class Encoder:
    """Messages to batches; keeps the E2E counter of each message."""

    __slots__ = ("_streams", "_writer")

    def __init__(self) -> None:
        kinds = {**plant.STREAMS, **controller.STREAMS}
        self._streams: dict[type, Stream[Any]] = {kind: make() for kind, make in kinds.items()}
        self._writer = BytesWriter()

    def encode(self, messages: Iterable[Message]) -> bytes:
        """Encode the messages of one tick, in order.

        Raises: CodecError when a value does not fit its signal, is nan or infinite
        """
        writer = self._writer
        writer.truncate(0)
        for message in messages:
            stream = self._streams[type(message)]
            counter = stream.counter + 1 & 0xF
            stream.counter = counter
            if message is not stream.message:
                stream.bare = stream.pack(message)
                stream.message = message
            write_i16_le(writer, stream.can_id)
            write_i64_le(writer, stream.bare ^ stream.marks[counter])
        return writer.getvalue()

    @property
    def counters(self) -> dict[int, int]:
        """Last counter by CAN identifier, -1 before the first frame."""
        return {int(stream.can_id): int(stream.counter) for stream in self._streams.values()}

    def remember(self) -> tuple[int, ...]:
        """Return all that the next batch depends on besides its messages: the counters."""
        return tuple(int(stream.counter) for stream in self._streams.values())

    def recall(self, counters: tuple[int, ...]) -> None:
        """Go on from what `remember` returned."""
        for stream, counter in zip(self._streams.values(), counters, strict=True):
            stream.counter = counter


class DecoderMemory(NamedTuple):
    """What a decoder knows of the past: by message the last counter and bare word, and counts."""

    streams: tuple[tuple[int, int], ...]
    counts: ReceptionCounts


@final
class Decoder:
    """Batches to messages of one sender; nothing that fails protection or range comes through."""

    __slots__ = ("_once", "_streams", "corrupted", "incomplete", "lost", "ok", "out_of_range",
                 "reordered", "repeated", "unknown")  # fmt: skip

    def __init__(self, sender: str) -> None:
        self._streams: list[Stream[Any]] = [make() for make in _SENDERS[sender].values()]
        self._once = [s for s in self._streams if LAYOUTS[s.can_id].per_tick == 1]
        self.ok: i64 = 0
        self.corrupted: i64 = 0
        self.repeated: i64 = 0
        self.reordered: i64 = 0
        self.lost: i64 = 0
        self.out_of_range: i64 = 0
        self.unknown: i64 = 0
        self.incomplete: i64 = 0

    def decode(self, batch: bytes) -> list[Message]:
        """Decode a batch into the messages that may be acted on, in the order of arrival."""
        decoded: list[Message] = []
        size: i64 = len(batch)
        at: i64 = 0
        while at <= size - FRAME_SIZE:
            can_id, word = read_i16_le(batch, at), read_i64_le(batch, at + 2)
            at += FRAME_SIZE
            for stream in self._streams:
                if stream.can_id == can_id:
                    break
            else:
                self.unknown += 1
                continue
            counter = stream.counter + 1 & 0xF
            bare = word ^ stream.marks[counter]
            if bare == stream.bare and stream.message is not None:
                stream.counter = counter
            elif not (stream.take(counter, bare) or self._comes_out_of_turn(stream, word)):
                continue
            if stream.message is None:
                self.out_of_range += 1
            else:
                decoded.append(stream.message)
        self.ok += len(decoded)
        self.incomplete += int(at < size)  # not from our encoder; what is whole is protected
        return decoded

    def _comes_out_of_turn(self, stream: Stream[Any], word: i64) -> bool:
        """Take a frame that is not right with the next counter: damaged, or with another one."""
        counter = word >> 8 & 0xF
        bare = word ^ stream.marks[counter]
        if crc8(bare) != bare & 0xFFF:
            self.corrupted += 1
            return False
        return self._may_follow(stream, counter) and stream.take(counter, bare)

    def _may_follow(self, stream: Stream[Any], counter: i64) -> bool:
        """Judge a counter that is not the next one: accept after a loss, refuse what is old."""
        if stream.counter < 0:
            return True
        delta = (counter - stream.counter) & 0xF
        if delta == 0:
            self.repeated += 1
            return False
        if delta > MAX_DELTA:
            self.reordered += 1
            return False
        self.lost += delta - 1
        return True

    def in_step(self) -> bool:
        """Whether what is sent once a tick came last from one and the same tick of the sender."""
        return self._once[0].counter == self._once[1].counter

    def forget_counters(self) -> None:
        """Accept any counter next: after a silence the sender may have been restarted."""
        for stream in self._streams:
            stream.counter = -1

    def remember(self) -> DecoderMemory:
        """Return all that decoding the next batch depends on."""
        streams = tuple([
            (int(stream.counter), -1 if stream.bare == -1 else unsigned(stream.bare))
            for stream in self._streams
        ])  # fmt: skip
        return DecoderMemory(streams, self.counts())

    def recall(self, memory: DecoderMemory) -> None:
        """Go on from what `remember` returned."""
        for stream, (counter, bare) in zip(self._streams, memory.streams, strict=True):
            stream.counter, stream.bare, stream.message = counter, -1, None
            if bare >= 0:
                stream.take(counter, signed(bare))
        for name, count in memory.counts._asdict().items():
            setattr(self, name, count)

    def counts(self) -> ReceptionCounts:
        """Return what was received so far, by verdict."""
        return ReceptionCounts(
            self.ok, self.corrupted, self.repeated, self.reordered, self.lost, self.out_of_range,
            self.unknown, self.incomplete,
        )  # fmt: skip
