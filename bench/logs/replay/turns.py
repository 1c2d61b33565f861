"""The turns of a loop, from the records in its log: what came in, when, and what it put.

A log holds the records of each turn one after the other, as they were put, so the turns are found
by walking over the records once, whatever length the log has. Nothing is decoded but the times.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Final, NamedTuple

from hil.log import Log, Span, topics
from hil.log.part import ALWAYS, TopicInfo
from hil.log.records import MESSAGE, MESSAGE_HEAD, PAYLOAD_OFFSET

FOREIGN_EVENTS: Final = ("real-time", "log-", "can-", "starter-")
"""How events begin that the process, its recorder or its bus add between the turns."""

_NAMES: Final = {topic.name: topic.channel_id for topic in topics.ALL}
_SENSOR, _TRUTH, _TIMING = (t.channel_id for t in (topics.SENSOR, topics.TRUTH, topics.TIMING))
_RECEIVED, _EVENT = topics.FRAMES_RECEIVED.channel_id, topics.EVENT.channel_id
_SNAPSHOT, _COMMAND = topics.SNAPSHOT.channel_id, topics.COMMAND.channel_id
_BATCH_AT: Final = PAYLOAD_OFFSET + topics.FRAMES_RECEIVED.layout.size + 4
_head_of: Final = struct.Struct("<BQH").unpack_from
_time_of: Final = struct.Struct("<8xq").unpack_from  # of /frames: behind the tick, aligned
_times_of: Final = struct.Struct("<" + topics.TIMING.layout.format[1:]).unpack_from

Mark = tuple[int, int, int]  # topic by today's channel number, first byte, end


class Turn(NamedTuple):
    """One turn as recorded.

    first_tick, tick : first and last tick that it stepped, -1 when it stepped none
    times_ns : what the pacer was asked, in order
    used_tick : what /timing says of the last tick
    snapshot : the state behind it and the tick that comes next, if it is there
    """

    first_tick: int
    tick: int
    scheduled_ns: int
    times_ns: tuple[int, ...]
    used_tick: int
    batches: tuple[bytes, ...]
    command: tuple[str, bytes] | None
    snapshot: tuple[int, str] | None
    recorded: bytes


class _Piece(NamedTuple):
    """The records of one tick, or of a batch that was not acted on."""

    data: bytes
    times: tuple[int, ...]
    batches: tuple[bytes, ...]
    command: tuple[str, bytes] | None
    snapshot: tuple[int, str] | None


def turns(log: Log, process: str, span: Span = ALWAYS) -> Iterator[Turn]:
    """Yield the turns of a log in order; the last one may be cut off within its records.

    Raises: LogError when the records are not in the order in which our recorder writes them
    """
    pieces = _pieces(log, process, span)
    return _controller_turns(pieces) if process == "controller" else _plant_turns(log, pieces)


def _controller_turns(pieces: Iterator[_Piece]) -> Iterator[Turn]:
    """Ticks that were missed belong to the turn of the batch that showed the gap."""
    earlier, dones, first = b"", [], -1
    for data, times, batches, command, snapshot in pieces:
        if len(times) == 1:  # a batch that was not acted on, and when that was decided
            yield Turn(-1, -1, 0, times, -1, batches, None, snapshot, data)
            continue
        tick, _, scheduled_ns, woke_ns, done_ns, used, missed = times
        if missed:
            earlier, first = earlier + data, tick if first < 0 else first
            dones.append(done_ns)
        elif dones:
            instants = (woke_ns, *dones, done_ns)
            whole = earlier + data
            yield Turn(first, tick, scheduled_ns, instants, used, batches, command, snapshot, whole)
            earlier, dones, first = b"", [], -1
        else:
            yield Turn(
                tick, tick, scheduled_ns, (woke_ns, done_ns), used, batches, command, snapshot, data
            )


def _plant_turns(log: Log, pieces: Iterator[_Piece]) -> Iterator[Turn]:
    """Ticks that were skipped belong to the turn that came too late for them."""
    earlier, first = b"", -1
    for data, times, batches, command, snapshot in pieces:
        if not times and snapshot is None:
            raise log.error("cannot be replayed: a tick without /timing")
        if not times:
            yield Turn(-1, -1, 0, (), -1, (), None, snapshot, data)
            continue
        tick, _, scheduled_ns, woke_ns, sent_ns, used, missed = times
        first = tick if first < 0 else first
        if missed:
            earlier += data
            continue
        instants = (woke_ns, sent_ns)
        whole = earlier + data if earlier else data
        yield Turn(first, tick, scheduled_ns, instants, used, batches, command, snapshot, whole)
        earlier, first = b"", -1


def _pieces(log: Log, process: str, span: Span) -> Iterator[_Piece]:
    """Cut the records where a tick begins.

    The controller's begins with /sensor, or is a batch that was not acted on; the plant's begins
    with /sensor, or is a tick that was skipped and has only /truth and /timing. A log that goes on
    from another begins with a snapshot.
    """
    odd, before_odd = (_RECEIVED, _TIMING) if process == "controller" else (_TRUTH, _SENSOR)
    numbers = _numbers(log)
    data = b""
    marks: list[Mark] = []
    leads: list[int] = []
    for chunk in log.raw(span):
        data = data[marks[leads[-1]][1] :] + chunk if leads else chunk
        data, marks = _without_foreign(log, data, _marks(data, numbers))
        leads, last = [], -1
        for place, (kind, _, _) in enumerate(marks):
            first = kind == _SNAPSHOT and last == -1
            if kind == _SENSOR or first or (kind == odd and last != before_odd):
                leads.append(place)
            last = kind
        for begin, end in pairwise(leads):
            yield _piece(log, data, marks[begin:end])
    if leads:
        last_one = _piece(log, data, marks[leads[-1] :])
        if last_one.times or last_one.snapshot or last_one.batches:
            yield last_one  # else it is cut off before it says anything


def _marks(data: bytes, numbers: dict[int, int]) -> list[Mark]:
    """Find the whole records."""
    marks, offset, size = [], 0, len(data)
    while offset + MESSAGE_HEAD.size <= size:
        _, length, number = _head_of(data, offset)
        end = offset + 9 + length
        if end > size:
            break
        marks.append((numbers[number], offset, end))
        offset = end
    return marks


def _without_foreign(log: Log, data: bytes, marks: list[Mark]) -> tuple[bytes, list[Mark]]:
    """Take out the events that no loop has put."""
    foreign = [
        mark
        for mark in marks
        if mark[0] == _EVENT and _values(log, "/event", data, mark)[3].startswith(FOREIGN_EVENTS)
    ]
    if not foreign:
        return data, marks
    for _, start, end in reversed(foreign):
        data = data[:start] + data[end:]
    return data, _marks(data, _numbers(log))


def _piece(log: Log, data: bytes, marks: list[Mark]) -> _Piece:
    """Take out of a piece what a replay needs to know."""
    times: tuple[int, ...] = ()
    batches: tuple[bytes, ...] = ()
    command = snapshot = None
    for kind, start, end in marks:
        if kind == _TIMING:
            times = _times_of(data, start + PAYLOAD_OFFSET)
        elif kind == _RECEIVED:
            batches = (*batches, data[start + _BATCH_AT : end])
            times = times or _time_of(data, start + PAYLOAD_OFFSET)
        elif kind == _COMMAND:
            *_, origin, raw = _values(log, "/command", data, (kind, start, end))
            command = (origin, raw)
        elif kind == _SNAPSHOT:
            tick, _, state = _values(log, "/snapshot", data, (kind, start, end))
            snapshot = (tick, state)
    return _Piece(data[marks[0][1] : marks[-1][2]], times, batches, command, snapshot)


def _numbers(log: Log) -> dict[int, int]:
    """Return today's channel number of each channel of the log; those of others are negative."""
    return {
        info.channel_id: _NAMES.get(name, -info.channel_id) for name, info in log.topics.items()
    }


def _values(log: Log, topic: str, data: bytes, mark: Mark) -> tuple[Any, ...]:
    return log.topics[topic].layout.unpack(data[mark[1] + PAYLOAD_OFFSET : mark[2]])


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
    by_number = {info.channel_id: info for info in known.values()}
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
