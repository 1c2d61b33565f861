"""What `hil diff` says."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from bench.logs.diff import Comparison
from bench.logs.diff_topic import MESSAGE, TopicGap
from bench.report.quantities import thousands
from bench.report.text_table import text_table

_KEYS_SHOWN, _WIDTH = 12, 67
_HEADS = ("topic", "both", "differ", "only A", "only B", "from tick")


def show(console: Console, a: Path, b: Path, found: Comparison) -> None:
    """Print where two logs part, why that may be, and how far each topic is apart."""
    for note in found.notes:
        console.print(f"  note: {note}", style="dim")
    rows = sum(gap.common for gap in found.topics)
    if found.first is None:
        where = "" if found.whole else " where both have ticks, and one of them has more"
        if found.lone:
            where += f" in what both have; only one has {', '.join(found.lone)}"
        style = "green" if found.same else "yellow"
        console.print(f"{a} and {b}: the same{where}, {thousands(rows)} messages", style=style)
        return
    first = found.first
    kind = "message" if first.field == MESSAGE else "tick"
    unit = f" [{first.unit}]" if first.unit else ""
    console.print(
        f"{a} and {b} part at {kind} {first.tick} (t = {first.t_ns * 1e-9:.6f} s): {first.topic} "
        f"{first.field}{unit}: A {_shown(first.recorded)}, B {_shown(first.replayed)}",
        style="red",
    )
    console.print(f"  {_reason(found)}")
    for key, left, right in found.configuration[:_KEYS_SHOWN]:
        console.print(f"  configuration: {key}: A {left}, B {right}")
    console.print(_table(found.topics), markup=False, soft_wrap=True)


def _reason(found: Comparison) -> str:
    if found.configuration and found.first is not None and found.first.tick == 0:
        return "the runs begin differently: see the configuration below"
    if found.from_input:
        peer = "plant" if found.process == "controller" else "controller"
        return (
            f"what the {found.process} was told differs first: "
            f"the cause lies in the {peer} or on the link"
        )
    return f"up to there the {found.process} was told the same: the cause lies in it"


def _table(gaps: tuple[TopicGap, ...]) -> str:
    """A row a topic, under it how far its fields are apart at most: 80 columns hold both."""
    shown = [gap for gap in gaps if gap.common or gap.only_a or gap.only_b]
    head, *rows = text_table([_HEADS, *map(_row, shown)]).split("\n")
    lines = [head]
    for gap, line in zip(shown, rows, strict=True):
        lines += [line, *([f"  at most {_largest(gap)}"] if gap.fields else [])]
    return "\n".join(f"  {line}" for line in lines)


def _row(gap: TopicGap) -> tuple[str, ...]:
    first = "" if gap.first is None else str(gap.first.tick)
    counts = (gap.common, gap.different, gap.only_a, gap.only_b)
    return gap.topic, *map(thousands, counts), first


def _largest(gap: TopicGap) -> str:
    """The fields that differ most often, as many as one line holds, and how many more there are."""
    ordered = sorted(gap.fields.items(), key=lambda item: -item[1].rows)
    words = [f"{name} {field.largest:.3g}" for name, field in ordered]
    count = max(n for n in range(1, len(words) + 1) if n == 1 or len(_joined(words, n)) <= _WIDTH)
    return _joined(words, count)


def _joined(words: list[str], count: int) -> str:
    more = f" and {len(words) - count} more" if count < len(words) else ""
    return ", ".join(words[:count]) + more


def _shown(value: object) -> str:
    text = value.hex() if isinstance(value, bytes) else repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
