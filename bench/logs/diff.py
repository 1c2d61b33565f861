"""Two logs side by side: where they part first, in what, and what of their inputs had differed."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.logs.replay.differences import Difference
from hil.log import Log, Span
from hil.log.part import ALWAYS

Rows = NDArray[Any]

# Within a tick causes come before effects; what is not listed comes last.
_ORDER = {
    "controller": ("/frames/received", "/sensor", "/command", "/stroke", "/demand", "/actuator",
                   "/frames/sent"),
    "plant": ("/frames/received", "/actuator", "/truth", "/sensor", "/frames/sent"),
}  # fmt: skip
_INPUTS = {
    "controller": ("/frames/received", "/sensor", "/command"),
    "plant": ("/frames/received", "/actuator"),
}
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


class Comparison(NamedTuple):
    """Two logs compared."""

    process: str
    topics: tuple[TopicGap, ...]
    first: Difference | None
    from_input: bool
    configuration: tuple[tuple[str, object, object], ...]
    notes: tuple[str, ...]
    whole: bool

    @property
    def same(self) -> bool:
        """Whether both have the same messages, from their first to their last."""
        return self.first is None and self.whole


def compare(a: Log, b: Log, *, timing: bool = False, left_out: Collection[str] = ()) -> Comparison:
    """Compare all topics that both have but those left out, in the memory of a few chunks.

    Raises: LogError when one of them is damaged
    """
    process = a.metadata.get("run", {}).get("process", "controller")
    both = [name for name in a.topics if name in b.topics and name not in left_out]
    span = _overlap(a, b)
    gaps = [_topic_gap(a, b, name, span, timing=timing) for name in both]
    order = _ORDER.get(process, ())
    ranked = sorted(
        (gap.first for gap in gaps if gap.first is not None),
        key=lambda d: (d.tick, order.index(d.topic) if d.topic in order else len(order)),
    )
    first = ranked[0] if ranked else None
    from_input = first is not None and first.topic in _INPUTS.get(process, ())
    return Comparison(
        process, tuple(gaps), first, from_input, tuple(_configuration(a, b)),
        _notes(a, b, timing), (a.start_ns, a.end_ns) == (b.start_ns, b.end_ns),
    )  # fmt: skip


def _overlap(a: Log, b: Log) -> Span:
    """Where both have ticks."""
    if (a.start_ns, a.end_ns) == (b.start_ns, b.end_ns):
        return ALWAYS
    return Span(max(a.start_ns, b.start_ns), min(a.end_ns, b.end_ns))


def _notes(a: Log, b: Log, timing: bool) -> tuple[str, ...]:
    notes = [f"{name} is only in A" for name in a.topics if name not in b.topics]
    notes += [f"{name} is only in B" for name in b.topics if name not in a.topics]
    processes = [log.metadata.get("run", {}).get("process", "unknown") for log in (a, b)]
    if processes[0] != processes[1]:
        notes.append(f"A is of the {processes[0]}, B of the {processes[1]}")
    if _overlap(a, b) is not ALWAYS:
        for name, log in (("A", a), ("B", b)):
            notes.append(f"{name}: {log.start_ns * 1e-9:.3f} to {log.end_ns * 1e-9:.3f} s")
    if not timing:
        notes.append("when ticks ran is not compared (--timing does)")
    return tuple(notes)


def _topic_gap(a: Log, b: Log, topic: str, span: Span, *, timing: bool) -> TopicGap:
    if a.topics[topic].layout.variable or b.topics[topic].layout.variable:
        return _by_record(a, b, topic, span)
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


def _record_difference(topic: str, a: Any, b: Any) -> Difference:  # noqa: ANN401
    some = a if b is None or (a is not None and a.tick <= b.tick) else b
    if a is None or b is None:
        values = ("there", "missing") if b is None else ("missing", "there")
        return Difference(some.tick, some.t_ns, topic, "record", *values)
    name = next(n for n in a._fields if getattr(a, n) != getattr(b, n, None))
    return Difference(some.tick, some.t_ns, topic, name, getattr(a, name), getattr(b, name, None))


def _configuration(a: Log, b: Log) -> Iterator[tuple[str, object, object]]:
    """Yield the keys of the configuration in which the runs differ."""
    trees = []
    for log in (a, b):
        attached = log.attachments.get("scenario.json")
        try:
            trees.append(dict(_flat(json.loads(attached.content), ""))) if attached else None
        except ValueError:
            raise log.error("its scenario.json is no JSON") from None
    if len(trees) < 2:
        return
    left, right = trees
    for key in sorted(left.keys() | right.keys()):
        if left.get(key) != right.get(key) and not key.startswith("link.zenoh."):
            yield key, left.get(key), right.get(key)


def _flat(tree: object, prefix: str) -> Iterator[tuple[str, object]]:
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from _flat(value, f"{prefix}.{key}" if prefix else key)
    else:
        yield prefix, tree
