"""Where the Message records of a chunk lie, as its message indexes tell it.

Compiled, the records are walked by native reads; interpreted, by `struct`, which costs less there.
"""

from __future__ import annotations

import struct
from typing import Final, final

from librt.strings import BytesWriter, read_i16_le, read_i32_le, read_i64_le, write_i64_le
from mypy_extensions import i64

from hil.log.packing import NATIVE
from hil.log.records import MESSAGE, MESSAGE_HEAD
from hil.values import Value

_HEAD_SIZE: Final = MESSAGE_HEAD.size


@final
class ChannelIndex(Value):
    """The messages of one channel: (log time, offset) as u64 pairs, and the span of the times."""

    __slots__ = ("pairs", "first_ns", "last_ns")

    def __init__(self, pairs: bytes, first_ns: int, last_ns: int) -> None:
        self.pairs = pairs
        self.first_ns = first_ns
        self.last_ns = last_ns

    @property
    def messages(self) -> int:
        """How many there are."""
        return len(self.pairs) // 16


@final
class MessageIndex(Value):
    """What a run of Message records holds, by channel.

    size: bytes of whole records; last_tick, last_t_ns: of the last record
    """

    __slots__ = ("channels", "size", "last_tick", "last_t_ns")

    def __init__(
        self, channels: dict[int, ChannelIndex], size: int, last_tick: int, last_t_ns: int
    ) -> None:
        self.channels = channels
        self.size = size
        self.last_tick = last_tick
        self.last_t_ns = last_t_ns

    @property
    def first_ns(self) -> int:
        """The earliest log time."""
        return min(channel.first_ns for channel in self.channels.values())

    @property
    def last_ns(self) -> int:
        """The latest log time."""
        return max(channel.last_ns for channel in self.channels.values())


def index_messages(data: bytes) -> MessageIndex:
    """Index the whole Message records at the beginning of `data`; a cut last one is left out.

    Raises: ValueError when there is another record
    """
    return _walk_natively(data) if NATIVE else _walk(data)


@final
class _Channel:
    """A channel's index in the making."""

    def __init__(self) -> None:
        self.pairs = BytesWriter()
        self.first_ns: i64 = 0x7FFFFFFFFFFFFFFF
        self.last_ns: i64 = -1


def _walk_natively(data: bytes) -> MessageIndex:
    channels: list[_Channel] = []
    size: i64 = len(data)
    offset: i64 = 0
    tick: i64 = 0
    t_ns: i64 = 0
    while offset + _HEAD_SIZE <= size:
        if data[offset] != MESSAGE:
            raise ValueError(f"no Message record at byte {offset}: opcode {data[offset]}")
        length = read_i64_le(data, offset + 1)
        if length < 0 or length > size - offset - 9:
            break
        number = i64(read_i16_le(data, offset + 9)) & 0xFFFF
        while number >= len(channels):
            channels.append(_Channel())
        tick = i64(read_i32_le(data, offset + 11)) & 0xFFFFFFFF
        t_ns = read_i64_le(data, offset + 15)
        if t_ns < 0:  # from 2^63 on, which no log of ours holds
            return _walk(data)
        _note(channels[number], t_ns, offset)
        offset += 9 + length
    found = {number: channel for number, channel in enumerate(channels) if len(channel.pairs)}
    indexes = {number: ChannelIndex(c.pairs.getvalue(), c.first_ns, c.last_ns)
               for number, c in found.items()}  # fmt: skip
    return MessageIndex(indexes, offset, tick, t_ns)


def _note(channel: _Channel, t_ns: i64, offset: i64) -> None:
    write_i64_le(channel.pairs, t_ns)
    write_i64_le(channel.pairs, offset)
    channel.first_ns = min(channel.first_ns, t_ns)
    channel.last_ns = max(channel.last_ns, t_ns)


def _walk(data: bytes) -> MessageIndex:
    found: dict[int, list[int]] = {}
    head_at = MESSAGE_HEAD.unpack_from
    size, offset, tick, t_ns = len(data), 0, 0, 0
    while offset + _HEAD_SIZE <= size:
        opcode, length, channel, sequence, log_time, _ = head_at(data, offset)
        if opcode != MESSAGE:
            raise ValueError(f"no Message record at byte {offset}: opcode {opcode}")
        end = offset + 9 + length
        if end > size:
            break
        if channel in found:
            found[channel] += (log_time, offset)
        else:
            found[channel] = [log_time, offset]
        offset, tick, t_ns = end, sequence, log_time
    indexes = {channel: ChannelIndex(struct.pack(f"<{len(flat)}Q", *flat), min(flat[::2]),
               max(flat[::2])) for channel, flat in found.items()}  # fmt: skip
    return MessageIndex(indexes, offset, tick, t_ns)
