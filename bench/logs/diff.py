"""Two logs side by side: where they part first, in what, and what of their inputs had differed."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from typing import NamedTuple

from bench.logs.diff_topic import TopicGap, topic_gap
from bench.logs.replay.differences import Difference
from hil.log import Log, Span
from hil.log.part import ALWAYS

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


class Comparison(NamedTuple):
    """Two logs compared."""

    process: str
    topics: tuple[TopicGap, ...]
    first: Difference | None
    from_input: bool
    configuration: tuple[tuple[str, object, object], ...]
    notes: tuple[str, ...]
    whole: bool
    lone: tuple[str, ...] = ()
    """Topics with messages that only one of them has."""

    @property
    def same(self) -> bool:
        """Whether both have the same messages, from their first to their last."""
        return self.first is None and self.whole and not self.lone


def compare(a: Log, b: Log, *, timing: bool = False, left_out: Collection[str] = ()) -> Comparison:
    """Compare all topics that both have but those left out, in the memory of a few chunks.

    A topic that has no tick, or is not decoded, is compared message by message, byte by byte.

    Raises: LogError when one of them is damaged, or they have nothing in common
    """
    process = a.metadata.get("run", {}).get("process", "controller")
    both = [name for name in a.topics if name in b.topics and name not in left_out]
    lone = tuple(n for x, y in ((a, b), (b, a)) for n, t in x.topics.items()
                 if n not in y.topics and n not in left_out and t.messages)  # fmt: skip
    if lone and not both:
        raise a.error(f"has no topic in common with {b.path}")
    span = _overlap(a, b)
    gaps = [topic_gap(a, b, name, span, timing=timing) for name in both]
    order = _ORDER.get(process, ())
    ranked = sorted(
        (gap.first for gap in gaps if gap.first is not None),
        key=lambda d: (d.tick, order.index(d.topic) if d.topic in order else len(order)),
    )
    first = ranked[0] if ranked else None
    from_input = first is not None and first.topic in _INPUTS.get(process, ())
    return Comparison(
        process, tuple(gaps), first, from_input, tuple(_configuration(a, b)),
        _notes(a, b, timing), (a.start_ns, a.end_ns) == (b.start_ns, b.end_ns), lone,
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
