"""SI values to frames and back: the only place where a scale is applied.

The frames of one tick are one `bytes` object, a batch: ten bytes a frame, the CAN identifier
(u16) and the eight data bytes as one little-endian word. Every link and the log carry it as is.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple

from hil.errors import CodecError
from hil.wire import messages as _messages
from hil.wire.e2e import CRC_SOURCE, CRC_TABLES, MAX_DELTA, ReceptionCounts, counter_marks
from hil.wire.fields import LAYOUTS, Layout, Placed, layout_of

FRAME: Final = struct.Struct("<HQ")
"""One frame of a batch: CAN identifier and data word."""

pack_frame: Final = FRAME.pack
iter_frames: Final = FRAME.iter_unpack

_NAN: Final = float("nan")
_DAMAGED: Final = object()
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


def _pack_source(layout: Layout) -> list[str]:
    """Source of `pack(msg) -> bare`: range-checked raw values, each at its place, and their CRC."""
    names = ", ".join(placed.name for placed in layout.fields)
    selector = next((p.name for p in layout.fields if p.signal.selects), "")
    source = ["def pack(msg):", f"    {names}, = msg"]
    for placed in layout.fields:
        signal, indent, raw = placed.signal, "    ", f"raw_{placed.name}"
        if signal.only_when is not None:
            source += [f"    {raw} = 0", f"    if {selector} == {signal.only_when}:"]
            indent = "        "
        value = f"round({placed.name} / {signal.scale!r})" if placed.is_float else placed.name
        low, high = signal.raw_range
        source += [
            f"{indent}{raw} = {value}",
            f"{indent}if not {low} <= {raw} <= {high}: fail({placed.name!r}, {placed.name})",
        ]
    source.append(f"    word = {' | '.join(_placed_source(placed) for placed in layout.fields)}")
    return [*source, f"    return word | {CRC_SOURCE}"]


def _placed_source(placed: Placed) -> str:
    """Source of a raw value within its range at its place; only a negative one needs a mask."""
    raw = f"raw_{placed.name}"
    if placed.signal.signed:
        raw = f"({raw} & {(1 << placed.signal.bits) - 1})"
    return f"{raw} << {placed.start_bit}"


def _unpack_source(layout: Layout) -> list[str]:
    """Source of `unpack(bare)`: the message, None for a value out of range, or DAMAGED."""
    selector = next((p.name for p in layout.fields if p.signal.selects), "")
    source = ["def unpack(word):", f"    if {CRC_SOURCE} != word & 0xFFF: return DAMAGED"]
    for placed in layout.fields:
        indent = "    "
        if placed.signal.only_when is not None:
            source += [
                f"    {placed.name} = NAN",
                f"    if {selector} == {placed.signal.only_when}:",
            ]
            indent = "        "
        source += [indent + line for line in _unpack_field(placed)]
    names = ", ".join(placed.name for placed in layout.fields)
    return [*source, f"    return new(cls, ({names},))"]


def _unpack_field(placed: Placed) -> list[str]:
    """Source lines that put one field's value into a variable of its name."""
    signal = placed.signal
    raw = f"word >> {placed.start_bit} & {(1 << signal.bits) - 1}"
    low, high = signal.raw_range
    width_low, width_high = 0, (1 << signal.bits) - 1
    if signal.signed:
        half = 1 << signal.bits - 1
        raw = f"({raw} ^ {half}) - {half}"
        width_low, width_high = -half, half - 1
    scale = f" * {signal.scale!r}" if placed.is_float else ""
    if (low, high) == (width_low, width_high):
        return [f"{placed.name} = {f'({raw}){scale}' if scale else raw}"]
    return [
        f"raw = {raw}",
        f"if not {low} <= raw <= {high}: return None",
        f"{placed.name} = raw{scale}",
    ]


def _refusal(layout: Layout, placed: Placed, value: object) -> str:
    """What is wrong with a value: message, signal, value (an integer as one) and range."""
    low, high = (raw * placed.signal.scale for raw in placed.signal.raw_range)
    accepted = f"accepted {low:.10g} to {high:.10g} {placed.signal.unit}".rstrip()
    return f"{layout.name}.{placed.name} = {value!r}: {accepted}"


def _no_number(message: _messages.Message) -> str:
    """Name the signal that would be on the wire and is nan or infinite."""
    layout = layout_of(type(message))
    pairs = [(placed, float(v)) for placed, v in zip(layout.fields, message, strict=True)]
    selected = next((value for placed, value in pairs if placed.signal.selects), None)
    return next(
        _refusal(layout, placed, value)
        for placed, value in pairs
        if not math.isfinite(value) and placed.signal.only_when in {None, selected}
    )


def _compile(layout: Layout) -> tuple[Callable[[Any], int], Callable[[int], Any]]:
    """Turn a layout into two functions; a loop over signals would cost three times as much."""

    def fail(name: str, value: object) -> None:
        placed = next(p for p in layout.fields if p.name == name)
        raise CodecError(_refusal(layout, placed, value))

    scope: dict[str, Any] = {
        "fail": fail, "new": tuple.__new__, "cls": layout.make, "NAN": _NAN, "DAMAGED": _DAMAGED,
        **CRC_TABLES,
    }  # fmt: skip
    source = "\n".join(_pack_source(layout) + _unpack_source(layout))
    exec(compile(source, f"<codec of {layout.name}>", "exec"), scope)
    return scope["pack"], scope["unpack"]


class _Codec:
    """What belongs to one message, shared by all encoders and decoders."""

    __slots__ = ("can_id", "layout", "marks", "pack", "unpack")

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.can_id = layout.can_id
        self.marks = counter_marks(layout.data_ids)
        self.pack, self.unpack = _compile(layout)


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
                    raise CodecError(_no_number(message)) from None
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
                if message is not _DAMAGED:
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
        if message is _DAMAGED:
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
