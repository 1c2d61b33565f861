"""The turns of a loop, from the records in its log: what came in, when, and what it put.

A log holds the records of each turn one after the other, as they were put, so the turns are found
by walking over the records once, whatever length the log has. Nothing is decoded but the times.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, Final

from bench.logs.replay import walk
from bench.logs.replay.turn import Turn
from hil.log import Log, Span, topics
from hil.log.part import ALWAYS, TopicInfo
from hil.log.records import MESSAGE, MESSAGE_HEAD, PAYLOAD_OFFSET

FOREIGN_EVENTS: Final = ("real-time", "log-", "can-", "starter-")
"""How events begin that the process, its recorder or its bus add between the turns."""

_NAMES: Final = {topic.name: topic.channel_id for topic in topics.EVERY}
_SENSOR, _TRUTH, _TIMING = (t.channel_id for t in (topics.SENSOR, topics.TRUTH, topics.TIMING))
_RECEIVED, _EVENT = topics.FRAMES_RECEIVED.channel_id, topics.EVENT.channel_id
_SNAPSHOT, _COMMAND = topics.SNAPSHOT.channel_id, topics.COMMAND.channel_id
_BATCH_AT: Final = PAYLOAD_OFFSET + topics.FRAMES_RECEIVED.layout.size + 4
_head_of: Final = struct.Struct("<BQH").unpack_from
_TIMES: Final = struct.Struct("<" + topics.TIMING.layout.format[1:])

_KINDS: Final = {
    process: walk.Kinds(
        _SENSOR, _TIMING, _RECEIVED, _EVENT, _COMMAND, _SNAPSHOT, odd=odd, before_odd=before
    )
    for process, odd, before in (("controller", _RECEIVED, _TIMING), ("plant", _TRUTH, _SENSOR))
}


def turns(log: Log, process: str, span: Span = ALWAYS) -> Iterator[Turn]:
    """Yield the turns of a log in order; the last one may be cut off within its records.

    Raises: LogError when the records are not in the order in which our recorder writes them
    """
    joiner = walk.Joiner(_TIMES, PAYLOAD_OFFSET, is_plant=process == "plant")
    for data, piece in _pieces(log, process, span):
        command = snapshot = None
        if piece.has_command:
            *_, origin, raw = _values(log, "/command", data, piece.command, piece.command_end)
            command = (origin, raw)
        if piece.has_snapshot:
            tick, _, state = _values(log, "/snapshot", data, piece.snapshot, piece.snapshot_end)
            snapshot = (tick, state)
        if piece.timing < 0 and snapshot is None and process == "plant":
            raise log.error("cannot be replayed: a tick without /timing")
        turn = joiner.turn(data, piece, command, snapshot)
        if turn is not None:
            yield turn


def _pieces(log: Log, process: str, span: Span) -> Iterator[tuple[bytes, walk.Piece]]:
    """Yield the pieces of all chunks; one that is cut off before it says anything is none."""
    numbers, kinds = _numbers(log), _KINDS[process]
    data = b""
    cuts: list[walk.Piece] = []
    for chunk in log.raw(span):
        data = data[cuts[-1].start :] + chunk if cuts else chunk
        cuts, events = walk.cut(data, numbers, kinds, _BATCH_AT)
        own = _without_foreign(log, data, events)
        if own is not data:
            data = own
            cuts, _ = walk.cut(data, numbers, kinds, _BATCH_AT)
        for piece in cuts[:-1]:
            yield data, piece
    if cuts:
        last = cuts[-1]
        if last.timing >= 0 or last.has_snapshot or last.batches:
            yield data, last


def _without_foreign(log: Log, data: bytes, events: list[tuple[int, int]]) -> bytes:
    """Take out the events that no loop has put."""
    for start, end in reversed(events):
        if _values(log, "/event", data, start, end)[3].startswith(FOREIGN_EVENTS):
            data = data[:start] + data[end:]
    return data


def _numbers(log: Log) -> dict[int, int]:
    """Return today's channel number of each channel of the log; those of others are negative."""
    return {
        number: _NAMES.get(name, -number)
        for name, info in log.topics.items()
        for number in info.channels
    }


def _values(log: Log, topic: str, data: bytes, start: int, end: int) -> tuple[Any, ...]:
    return log.topics[topic].layout.unpack(data[start + PAYLOAD_OFFSET : end])


def check_layouts(log: Log) -> None:
    """Make sure that what a replay needs lies in this log where it does today.

    Raises: LogError naming the topic that is missing or other
    """
    for topic in (topics.TIMING, topics.FRAMES_RECEIVED):
        if topic.name not in log.topics:
            raise log.error(f"cannot be replayed: it has no {topic.name}")
        if log.topics[topic.name].layout.format != topic.layout.format:
            raise log.error(f"cannot be replayed: its {topic.name} has other fields than today's")


def split(
    known: dict[str, TopicInfo], data: bytes
) -> list[tuple[str, tuple[str, ...], tuple[object, ...]]]:
    """Decode records: topic, field names, values. A record that is cut off at the end is left out.

    Raises: ValueError when the bytes are no such records
    """
    by_number = {number: info for info in known.values() for number in info.channels}
    found, offset = [], 0
    while offset + MESSAGE_HEAD.size <= len(data):
        opcode, length, number = _head_of(data, offset)
        end = offset + 9 + length
        if opcode != MESSAGE or number not in by_number or end > len(data):
            raise ValueError("records that are none of its topics")
        info = by_number[number]
        names = tuple(field.name for field in info.fields)
        found.append((info.name, names, info.layout.unpack(data[offset + PAYLOAD_OFFSET : end])))
        offset = end
    return found
