"""What differs between the records of a turn as recorded and as replayed."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import NamedTuple

from bench.logs.replay.turn import Turn
from bench.logs.replay.turns import split
from hil.log import Log, topics
from hil.log.coding import of_layout
from hil.log.part import TopicInfo

Values = dict[str, object]


class Difference(NamedTuple):
    """One field with both values; a field of a record that only one side has is "record"."""

    tick: int
    t_ns: int
    topic: str
    field: str
    recorded: object
    replayed: object
    unit: str = ""


_TODAY = {
    topic.name: TopicInfo(topic.name, 0, (topic.channel_id,), of_layout(topic.layout))
    for topic in topics.ALL
}


class Records:
    """Decodes both sides, and knows which topics and fields only one of them has."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self.told: set[str] = set()
        self._known = {name: {f.name for f in info.fields} for name, info in log.topics.items()}
        own = {name: info for name, info in log.topics.items() if name == topics.LAW.name}
        self._today = {**_TODAY, **own}  # a law of the user's own tells what its log says
        self._new = {name: {f.name for f in info.fields} for name, info in self._today.items()}
        self._units = {(t.name, f.name): f.unit for t in self._today.values() for f in t.fields}

    def then(self, data: bytes) -> list[tuple[str, Values]]:
        """Decode what was recorded, as far as today's records have it too."""
        try:
            return self._shared(split(self._log.topics, data))
        except ValueError as error:
            raise self._log.error(str(error)) from None

    def now(self, data: bytes) -> list[tuple[str, Values]]:
        """Decode what was replayed, as far as the log has it too."""
        return self._shared(split(self._today, data))

    def unit(self, topic: str, field: str) -> str:
        """Return the unit of a field."""
        return self._units.get((topic, field), "")

    def notes(self) -> list[str]:
        """Name what only one side has, and so was not compared."""
        told = sorted(self.told)
        for name in sorted(self._known.keys() ^ self._new.keys()):
            where = "the log" if name in self._known else "today's records"
            told.append(f"{name} is only in {where}: not compared")
        for name in sorted(self._known.keys() & self._new.keys()):
            told += [
                f"{name}.{field} is only in {'the log' if field in self._known[name] else 'today'}"
                ": not compared"
                for field in sorted(self._known[name] ^ self._new[name])
            ]
        return told

    def _shared(
        self, records: list[tuple[str, tuple[str, ...], tuple[object, ...]]]
    ) -> list[tuple[str, Values]]:
        shared = []
        for name, fields, values in records:
            both = self._known.get(name, set()) & self._new.get(name, set())
            if both:
                chosen = zip(fields, values, strict=True)
                shared.append((name, {field: v for field, v in chosen if field in both}))
        return shared


def differences_of(records: Records, turn: Turn, replayed: bytes) -> list[Difference]:
    """Return the fields that differ, in the order of the records; none when all values agree."""
    then, now = records.then(turn.recorded), records.now(replayed)
    found: list[Difference] = []
    for number in range(max(len(then), len(now))):
        old = then[number] if number < len(then) else None
        new = now[number] if number < len(now) else None
        if old is None or new is None or old[0] != new[0]:
            found.append(_other_record(old, new, turn))
            break
        found += _fields(records, old[0], old[1], new[1], turn)
    return found


def _other_record(
    old: tuple[str, Values] | None, new: tuple[str, Values] | None, turn: Turn
) -> Difference:
    """Where one side has another record than the other, or none."""
    name, values = old or new or ("", {})
    tick, t_ns = _stamp(values, turn)
    return Difference(tick, t_ns, name, "record", _short(old), _short(new))


def _short(record: tuple[str, Values] | None) -> str:
    if record is None:
        return "none"
    name, values = record
    told = ", ".join(f"{k} {v}" for k, v in values.items() if k not in {"tick", "t_ns", "state"})
    return f"{name} {told}"


def _stamp(values: Values, turn: Turn) -> tuple[int, int]:
    tick, t_ns = values.get("tick", turn.first_tick), values.get("t_ns", 0)
    return (tick if isinstance(tick, int) else turn.tick), (t_ns if isinstance(t_ns, int) else 0)


def _fields(records: Records, name: str, old: Values, new: Values, turn: Turn) -> list[Difference]:
    tick, t_ns = _stamp(old, turn)
    if name == topics.SNAPSHOT.name:
        return _states(records, str(old["state"]), str(new["state"]), (tick, t_ns))
    return [
        Difference(tick, t_ns, name, field, value, new[field], records.unit(name, field))
        for field, value in old.items()
        if not same(value, new[field])
    ]


def _states(records: Records, old: str, new: str, stamp: tuple[int, int]) -> list[Difference]:
    """Compare two snapshots leaf by leaf; of different versions of the loop they say nothing."""
    then, now = json.loads(old), json.loads(new)
    if _shape(then) != _shape(now):
        records.told.add("/snapshot is of another version of the loop: not compared")
        return []
    return [
        Difference(*stamp, topics.SNAPSHOT.name, place, a, b)
        for (place, a), (_, b) in zip(_leaves(then, "state"), _leaves(now, "state"), strict=True)
        if not same(a, b)
    ]


def _shape(tree: object) -> object:
    if isinstance(tree, list):
        return [_shape(item) for item in tree]
    return {k: _shape(v) for k, v in tree.items()} if isinstance(tree, dict) else None


def _leaves(tree: object, place: str) -> Iterator[tuple[str, object]]:
    """Yield the plain values of a tree with their places."""
    if isinstance(tree, (list, dict)):
        items = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, value in items:
            yield from _leaves(value, f"{place}.{key}")
    else:
        yield place, tree


def same(a: object, b: object) -> bool:
    """Whether two values are the same bits; nan is nan, and -0.0 is not 0.0."""
    if isinstance(a, float) and isinstance(b, float):
        if math.isnan(a) or math.isnan(b):
            return math.isnan(a) and math.isnan(b)
        return a == b and math.copysign(1.0, a) == math.copysign(1.0, b)
    return a == b
