"""SI values to frames and back, protected end to end.

The frames of one tick are one `bytes` object, a batch: ten bytes a frame, the CAN identifier
(u16) and the eight data bytes as one little-endian word. Every link and the log carry it as is.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple

from hil.errors import CodecError
from hil.wire import messages as _messages
from hil.wire.e2e import MAX_DELTA, ReceptionCounts, counter_marks
from hil.wire.fields import LAYOUTS, Layout
from hil.wire.packing import DAMAGED, compile_layout, no_number

FRAME: Final = struct.Struct("<HQ")
"""One frame of a batch: CAN identifier and data word."""

pack_frame: Final = FRAME.pack
iter_frames: Final = FRAME.iter_unpack

_BATCHES: Final = tuple(struct.Struct("<" + "HQ" * frames) for frames in range(17))


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


class _Codec:
    """What belongs to one message, shared by all encoders and decoders."""

    __slots__ = ("can_id", "layout", "marks", "pack", "unpack")

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.can_id = layout.can_id
        self.marks = counter_marks(layout.data_ids)
        self.pack, self.unpack = compile_layout(layout)


_CODECS: Final = {can_id: _Codec(layout) for can_id, layout in LAYOUTS.items()}


class _Stream:
    """One message on its way in one direction: its codec, counter, and last value.

    `bare` is the word without counter, CRC of the payload included; while a payload repeats,
    as commands and pulses do, neither packing nor CRC is worked out again.
    """

    __slots__ = ("bare", "can_id", "counter", "marks", "message", "pack", "unpack")

    def __init__(self, codec: _Codec) -> None:
        self.can_id, self.marks = codec.can_id, codec.marks
        self.pack, self.unpack = codec.pack, codec.unpack
        self.counter = -1
        self.bare = -1
        self.message: Any = None


class Encoder:
    """Messages to batches; keeps the E2E counter of each message."""

    __slots__ = ("_streams",)

    def __init__(self) -> None:
        self._streams = {codec.layout.make: _Stream(codec) for codec in _CODECS.values()}

    def encode(self, messages: Iterable[_messages.Message]) -> bytes:
        """Encode the messages of one tick, in order; at most 16.

        Raises: CodecError when a value does not fit its signal, is nan or infinite
        """
        frames: list[int] = []
        for message in messages:
            stream = self._streams[type(message)]
            counter = stream.counter = stream.counter + 1 & 0xF
            if message != stream.message:
                try:
                    stream.bare = stream.pack(message)
                except (ValueError, OverflowError):
                    raise CodecError(no_number(message)) from None
                stream.message = message
            frames += (stream.can_id, stream.bare ^ stream.marks[counter])
        return _BATCHES[len(frames) >> 1].pack(*frames)

    @property
    def counters(self) -> dict[int, int]:
        """Last counter by CAN identifier, -1 before the first frame."""
        return {stream.can_id: stream.counter for stream in self._streams.values()}

    def remember(self) -> tuple[int, ...]:
        """Return all that the next batch depends on besides its messages: the counters."""
        return tuple(stream.counter for stream in self._streams.values())

    def recall(self, counters: tuple[int, ...]) -> None:
        """Go on from what `remember` returned."""
        for stream, counter in zip(self._streams.values(), counters, strict=True):
            stream.counter = counter


class DecoderMemory(NamedTuple):
    """What a decoder knows of the past: by message the last counter and bare word, and counts."""

    streams: tuple[tuple[int, int], ...]
    counts: ReceptionCounts


class Decoder:
    """Batches to messages of one sender; nothing that fails protection or range comes through."""

    __slots__ = ("_once", "_streams", "corrupted", "incomplete", "lost", "ok", "out_of_range",
                 "reordered", "repeated", "unknown")  # fmt: skip

    def __init__(self, sender: str) -> None:
        self._streams = {
            can_id: _Stream(codec)
            for can_id, codec in _CODECS.items()
            if codec.layout.sender == sender
        }
        self._once = tuple(
            stream
            for can_id, stream in self._streams.items()
            if _CODECS[can_id].layout.per_tick == 1
        )
        self.ok = self.corrupted = self.repeated = self.reordered = 0
        self.lost = self.out_of_range = self.unknown = self.incomplete = 0

    def decode(self, batch: bytes) -> list[Any]:
        """Decode a batch into the messages that may be acted on, in the order of arrival."""
        decoded = []
        if len(batch) % FRAME.size:  # not from our encoder; what is whole in it is protected
            self.incomplete += 1
            batch = batch[: len(batch) - len(batch) % FRAME.size]
        find = self._streams.get
        for can_id, word in iter_frames(batch):
            stream = find(can_id)
            if stream is None:
                self.unknown += 1
                continue
            counter = stream.counter + 1 & 0xF
            bare = word ^ stream.marks[counter]
            if bare == stream.bare:
                stream.counter = counter
            else:
                message = stream.unpack(bare)
                if message is not DAMAGED:
                    stream.counter, stream.bare, stream.message = counter, bare, message
                elif not self._comes_out_of_turn(stream, word):
                    continue
            if stream.message is None:
                self.out_of_range += 1
            else:
                decoded.append(stream.message)
        self.ok += len(decoded)
        return decoded

    def _comes_out_of_turn(self, stream: _Stream, word: int) -> bool:
        """Take a frame that is not right with the next counter: damaged, or with another one."""
        counter = word >> 8 & 0xF
        bare = word ^ stream.marks[counter]
        message = stream.unpack(bare)
        if message is DAMAGED:
            self.corrupted += 1
            return False
        if not self._may_follow(stream, counter):
            return False
        stream.counter, stream.bare, stream.message = counter, bare, message
        return True

    def _may_follow(self, stream: _Stream, counter: int) -> bool:
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
        first, second = self._once
        return first.counter == second.counter

    def forget_counters(self) -> None:
        """Accept any counter next: after a silence the sender may have been restarted."""
        for stream in self._streams.values():
            stream.counter = -1

    def remember(self) -> DecoderMemory:
        """Return all that decoding the next batch depends on."""
        streams = tuple((stream.counter, stream.bare) for stream in self._streams.values())
        return DecoderMemory(streams, self.counts())

    def recall(self, memory: DecoderMemory) -> None:
        """Go on from what `remember` returned."""
        for stream, (counter, bare) in zip(self._streams.values(), memory.streams, strict=True):
            stream.counter, stream.bare = counter, bare
            stream.message = None if bare < 0 else stream.unpack(bare)
        for name, count in memory.counts._asdict().items():
            setattr(self, name, count)

    def counts(self) -> ReceptionCounts:
        """Return what was received so far, by verdict."""
        return ReceptionCounts(
            self.ok, self.corrupted, self.repeated, self.reordered, self.lost, self.out_of_range,
            self.unknown, self.incomplete,
        )  # fmt: skip
