"""What `hil diff` says."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.logs.diff import Comparison
from bench.logs.diff_topic import MESSAGE, TopicGap
from bench.report.quantities import thousands

_KEYS_SHOWN = 12


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
    console.print(_table(found.topics))


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


def _table(gaps: tuple[TopicGap, ...]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 2), header_style="dim")
    for title in ("topic", "both", "differ", "only A", "only B", "from tick", "largest difference"):
        is_text = title in {"topic", "largest difference"}
        table.add_column(title, justify="left" if is_text else "right")
    for gap in gaps:
        if not (gap.common or gap.only_a or gap.only_b):
            continue
        first = "" if gap.first is None else str(gap.first.tick)
        table.add_row(
            gap.topic, thousands(gap.common), thousands(gap.different), thousands(gap.only_a),
            thousands(gap.only_b), first, _largest(gap),
        )  # fmt: skip
    return table


def _largest(gap: TopicGap) -> str:
    shown = sorted(gap.fields.items(), key=lambda item: -item[1].rows)[:4]
    return ", ".join(f"{name} {field.largest:.3g}" for name, field in shown)


def _shown(value: object) -> str:
    text = value.hex() if isinstance(value, bytes) else repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
