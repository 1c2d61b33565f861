"""The end of `hil run` on the terminal: verdict, figures, where to read on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.judge.summary import Summary
from bench.judge.verdict import VERDICTS

if TYPE_CHECKING:
    from rich.console import Console

Row = tuple[str, str]
_COLOURS = dict.fromkeys(VERDICTS, "red") | {"met": "green", "none": "yellow"}


def show(console: Console, summary: Summary, report: Path | None, directory: Path) -> None:
    """Print verdict, expectations, a table of figures and the paths."""
    from rich.table import Table
    from rich.text import Text

    verdict = summary["verdict"]
    told = VERDICTS[verdict] if verdict == "none" else verdict
    head = Text.assemble((summary["scenario"], "bold"), ": ", (told, f"bold {_COLOURS[verdict]}"))
    console.print(head)
    if summary["cause"] and summary["cause"] in summary["exit_reason"]:
        console.print(Text("  ! ", style="yellow") + Text(summary["cause"]), soft_wrap=True)
    for line in summary["refused"]:
        console.print(Text("  ✗ ", style="red") + Text(line, style=""), soft_wrap=True)
    for check in summary["expectations"]:
        sign = Text("  ✓ " if check["met"] else "  ✗ ", style="green" if check["met"] else "red")
        console.print(sign + Text(check["text"], style=""), soft_wrap=True)
    table = Table.grid(padding=(0, 2))
    for style in ("dim", "", "dim", ""):
        table.add_column(style=style, no_wrap=True)
    left, right = motion_rows(summary["figures"]), tick_rows(summary["figures"])
    height = max(len(left), len(right))
    for a, b in zip(_padded(left, height), _padded(right, height), strict=True):
        table.add_row(f"  {a[0]}", a[1], b[0], b[1])
    console.print(table)
    for name in ("plant", "controller"):
        if late := _lateness(summary["figures"], name):
            text = Text.assemble((f"  {name + ' late':<18}", "dim"), late)
            console.print(text, soft_wrap=True)
    where = report if report is not None else directory
    console.print(
        Text.assemble(("report " if report else "logs ", "dim"), str(where)), soft_wrap=True
    )


def _padded(rows: list[Row], height: int) -> list[Row]:
    return rows + [("", "")] * (height - len(rows))


def motion_rows(figures: dict[str, Any]) -> list[Row]:
    """What the engine did."""
    rows = [
        ("peak TDC error", _number(figures, "tdc_error_peak_mm", "{:.3f} mm")),
        ("settling", _number(figures, "settling_s", "{:.1f} ms", 1e3) or "not settled"),
        ("TDC mean", _number(figures, "tdc_mean_mm", "{:.3f}")
         + _number(figures, "tdc_sigma_mm", " ± {:.3f} mm")),
        ("TDC at the end", _number(figures, "tdc_final_mm", "{:.3f} mm")),
        ("frequency", _number(figures, "frequency_final_hz", "{:.2f} Hz")),
        ("fuel at the end", _number(figures, "fuel_final_mg", "{:.3f} mg")),
        ("electric power", _number(figures, "electric_power_mean_w", "{:.0f} W")),
        ("misfires, contacts", f"{figures.get('misfires')}, {figures.get('contacts')}"),
    ]  # fmt: skip
    return [row for row in rows if row[1]]


def tick_rows(figures: dict[str, Any]) -> list[Row]:
    """How the ticks went."""
    rows = [("ticks", f"{figures.get('plant_ticks')}, {figures.get('plant_missed_ticks')} missed")]
    rows += [
        ("answered next tick", _number(figures, "answered_next_tick_share", "{:.2f} %", 100.0)),
        ("sample age p99", _number(figures, "sample_age_p99_ticks", "{:d} ticks")),
        ("processor use", _number(figures, "processor_cores", "{:.0f} % of a core", 100.0)),
        ("speed", _number(figures, "speed_sim_s_per_wall_s", "{:.1f} × real time")),
    ]
    return [row for row in rows if row[1]]


def _lateness(figures: dict[str, Any], name: str) -> str:
    keys = (f"{name}_late_{q}_us" for q in ("p50", "p99", "p99_9", "max"))
    values = [figures.get(key) for key in keys]
    if any(value is None for value in values):
        return ""
    shown = " / ".join(f"{value:.0f}" for value in values)
    return f"{shown} µs  (p50 / p99 / p99.9 / max)"


def _number(figures: dict[str, Any], key: str, text: str, factor: float = 1) -> str:
    value = figures.get(key)
    return "" if value is None else text.format(value * factor)
