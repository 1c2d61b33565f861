"""How far one topic of two logs is apart: by rows, by records, or message by message."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.logs.replay.differences import Difference
from hil.log import Log, Span, TopicInfo

Rows = NDArray[Any]

_WHOLE = {"uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64"}
MESSAGE = "message"
"""Field of a difference between messages that were compared by their bytes."""

_CLOCK = ("scheduled_ns", "woke_ns", "done_ns")


class FieldGap(NamedTuple):
    """How far a field is apart: rows that differ, and the largest difference of two numbers."""

    rows: int
    largest: float


class TopicGap(NamedTuple):
    """What two logs have of a topic."""

    topic: str
    common: int
    different: int
    only_a: int
    only_b: int
    first: Difference | None
    fields: dict[str, FieldGap]

    @property
    def same(self) -> bool:
        """Whether both have the same rows."""
        return self.first is None


def topic_gap(a: Log, b: Log, topic: str, span: Span, *, timing: bool) -> TopicGap:
    """Compare a topic that both logs have, in the memory of a few chunks.

    One that has no tick, or is not decoded, is compared message by message, byte by byte.

    Raises: LogError when one of them is damaged
    """
    infos = (a.topics[topic], b.topics[topic])
    if not all(_has_ticks(info) for info in infos):
        return _by_message(a, b, topic, span)
    if not all(info.coding.fixed for info in infos):
        return _by_record(a, b, topic, span)
    return _by_row(a, b, topic, span, timing=timing)


def _by_row(a: Log, b: Log, topic: str, span: Span, *, timing: bool) -> TopicGap:
    """Topics of a fixed size: chunk by chunk, rows of the same tick."""
    left = {field.name for field in a.topics[topic].fields}
    shared = [f for f in b.topics[topic].fields if f.name in left]
    if topic == "/timing" and not timing:
        shared = [field for field in shared if field.name not in _CLOCK]
    units = {field.name: field.unit for field in shared}
    common = different = only_a = only_b = 0
    first: Difference | None = None
    fields: dict[str, FieldGap] = {}
    for rows_a, rows_b, rest_a, rest_b in _aligned(a.blocks(topic, span), b.blocks(topic, span)):
        common, only_a, only_b = common + len(rows_a), only_a + len(rest_a), only_b + len(rest_b)
        apart = {name: _unequal(rows_a[name], rows_b[name]) for name in units}
        any_apart = np.logical_or.reduce(list(apart.values())) if apart else np.zeros(0, bool)
        different += int(any_apart.sum())
        candidates = [*_lone(topic, rest_a, 0), *_lone(topic, rest_b, 1)]
        if any_apart.any():
            at = int(np.flatnonzero(any_apart)[0])
            name = next(n for n in units if apart[n][at])
            candidates.append(_difference(topic, name, units[name], rows_a[at], rows_b[at]))
        if first is None and candidates:
            first = min(candidates, key=lambda d: d.tick)
        for name in units:
            if apart[name].any():
                fields[name] = _widened(fields.get(name), rows_a[name], rows_b[name], apart[name])
    return TopicGap(topic, common, different, only_a, only_b, first, fields)


def _aligned(a: Iterator[Rows], b: Iterator[Rows]) -> Iterator[tuple[Rows, Rows, Rows, Rows]]:
    """Yield rows of the same tick from both, and those that only one of them has."""
    left, right = next(a, None), next(b, None)
    while left is not None and right is not None:
        limit = min(left["tick"][-1:].tolist() + right["tick"][-1:].tolist(), default=0)
        cut_a = int(np.searchsorted(left["tick"], limit, side="right"))
        cut_b = int(np.searchsorted(right["tick"], limit, side="right"))
        head_a, head_b = left[:cut_a], right[:cut_b]
        _, in_a, in_b = np.intersect1d(head_a["tick"], head_b["tick"], return_indices=True)
        rest_a, rest_b = np.ones(cut_a, bool), np.ones(cut_b, bool)
        rest_a[in_a], rest_b[in_b] = False, False
        yield head_a[in_a], head_b[in_b], head_a[rest_a], head_b[rest_b]
        left, right = left[cut_a:], right[cut_b:]
        left = left if len(left) else next(a, None)
        right = right if len(right) else next(b, None)
    for rows, others, is_a in ((left, a, True), (right, b, False)):
        rest = rows
        while rest is not None:
            none = rest[:0]
            yield (none, none, rest, none) if is_a else (none, none, none, rest)
            rest = next(others, None)


def _unequal(a: Rows, b: Rows) -> NDArray[np.bool_]:
    """Compare bit by bit; nan is nan."""
    if a.dtype.kind == "f":
        bits = f"u{a.dtype.itemsize}"
        left, right = np.ascontiguousarray(a).view(bits), np.ascontiguousarray(b).view(bits)
        unequal: NDArray[np.bool_] = (left != right) & ~(np.isnan(a) & np.isnan(b))
    else:
        unequal = a != b
    return np.asarray(unequal.any(axis=1) if unequal.ndim > 1 else unequal)


def _widened(known: FieldGap | None, a: Rows, b: Rows, apart: NDArray[np.bool_]) -> FieldGap:
    rows, largest = known or FieldGap(0, 0.0)
    gap = np.abs(a[apart].astype(np.float64) - b[apart].astype(np.float64))
    finite = gap[np.isfinite(gap)]
    return FieldGap(rows + int(apart.sum()), max(largest, float(finite.max(initial=0.0))))


def _lone(topic: str, rows: Rows, side: int) -> list[Difference]:
    """A row that only one log has."""
    if not len(rows):
        return []
    tick, t_ns = int(rows["tick"][0]), int(rows["t_ns"][0])
    values = ("there", "missing") if side == 0 else ("missing", "there")
    return [Difference(tick, t_ns, topic, "record", *values)]


def _difference(topic: str, name: str, unit: str, a: Any, b: Any) -> Difference:  # noqa: ANN401
    return Difference(
        int(a["tick"]), int(a["t_ns"]), topic, name, a[name].tolist(), b[name].tolist(), unit
    )


def _by_record(a: Log, b: Log, topic: str, span: Span) -> TopicGap:
    """Topics of varying size: record by record, those of a tick in their order."""
    common = different = only_a = only_b = 0
    first: Difference | None = None
    for left, right in _paired(a.records(topic, span), b.records(topic, span)):
        if left is not None and right is not None:
            common += 1
            if left == right:
                continue
            different += 1
        only_a, only_b = only_a + (right is None), only_b + (left is None)
        both = left is not None and right is not None
        if first is None and (both or topic != "/snapshot"):  # snapshots may be taken at will
            first = _record_difference(topic, left, right)
    return TopicGap(topic, common, different, only_a, only_b, first, {})


def _paired(a: Iterator[Any], b: Iterator[Any]) -> Iterator[tuple[Any, Any]]:
    """Yield records of the same tick together, and alone those that have no other."""
    left, right = next(a, None), next(b, None)
    while left is not None or right is not None:
        if right is None or (left is not None and left.tick < right.tick):
            yield left, None
            left = next(a, None)
        elif left is None or right.tick < left.tick:
            yield None, right
            right = next(b, None)
        else:
            yield left, right
            left, right = next(a, None), next(b, None)


def _has_ticks(info: TopicInfo) -> bool:
    kinds = {field.name: field.type for field in info.fields}
    return kinds.get("tick") in _WHOLE and kinds.get("t_ns") in _WHOLE


def _by_message(a: Log, b: Log, topic: str, span: Span) -> TopicGap:
    """Topics of others: message by message in their order, log time and bytes."""
    common = different = only_a = only_b = 0
    first: Difference | None = None
    pairs = zip_longest(a.payloads(topic, span), b.payloads(topic, span))
    for number, (left, right) in enumerate(pairs):
        only_a, only_b = only_a + (right is None), only_b + (left is None)
        common += left is not None and right is not None
        if left == right:
            continue
        different += left is not None and right is not None
        if first is None:
            t_ns = (left or right or (0, b""))[0]
            first = Difference(number, t_ns, topic, MESSAGE, _bytes_told(left), _bytes_told(right))
    return TopicGap(topic, common, different, only_a, only_b, first, {})


def _bytes_told(message: tuple[int, bytes] | None) -> str:
    if message is None:
        return "missing"
    t_ns, data = message
    return f"{len(data)} bytes at {t_ns} ns, CRC {zlib.crc32(data):08x}"


def _record_difference(topic: str, a: Any, b: Any) -> Difference:  # noqa: ANN401
    some = a if b is None or (a is not None and a.tick <= b.tick) else b
    if a is None or b is None:
        values = ("there", "missing") if b is None else ("missing", "there")
        return Difference(some.tick, some.t_ns, topic, "record", *values)
    name = next(n for n in a._fields if getattr(a, n) != getattr(b, n, None))
    return Difference(some.tick, some.t_ns, topic, name, getattr(a, name), getattr(b, name, None))
