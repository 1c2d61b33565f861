"""The look of the report page, its tables and tiles, and which figures stand at its top."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple


class Tile(NamedTuple):
    """One figure at the top of the page, with another one below it in small."""

    title: str
    key: str
    unit: str
    format: str = "{:.2f}"
    factor: float = 1.0
    extra_key: str = ""
    extra: str = ""


TILES = (
    Tile("Peak TDC error", "tdc_error_peak_mm", "mm", "{:.3f}"),
    Tile("Settling", "settling_s", "ms", "{:.1f}", 1e3, "settling_band_mm", "to ± {:g} mm"),
    Tile("TDC mean", "tdc_mean_mm", "mm", "{:.3f}", 1.0, "tdc_sigma_mm", "σ {:.3f} mm"),
    Tile("Frequency", "frequency_final_hz", "Hz", "{:.2f}", 1.0, "strokes", "{} strokes"),
    Tile("Fuel at the end", "fuel_final_mg", "mg", "{:.3f}", 1.0, "fuel_mean_mg", "mean {:.3f} mg"),
    Tile("Electric power", "electric_power_mean_w", "W", "{:.0f}", 1.0,
         "electric_energy_j", "{:.0f} J in all"),
    Tile("Plant late p99", "plant_late_p99_us", "µs", "{:.0f}", 1.0,
         "plant_late_max_us", "max {:.0f} µs"),
    Tile("Answered in time", "answered_next_tick_share", "%", "{:.2f}", 100.0,
         "plant_missed_ticks", "{} ticks missed"),
    Tile("Speed", "speed_sim_s_per_wall_s", "×", "{:.1f}", 1.0,
         "simulated_s", "{:g} s simulated"),
)  # fmt: skip

STYLE = """
:root { --ink: #1d2430; --soft: #5b6472; --line: #e3e7ed; --paper: #ffffff; --ground: #f5f6f8;
  --good: #1e7d57; --bad: #c0392b; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 24px 64px; }
header { display: flex; justify-content: space-between; align-items: flex-start; gap: 24px; }
h1 { font-size: 26px; margin: 0 0 2px; letter-spacing: -0.01em; }
h2 { font-size: 16px; margin: 28px 0 10px; }
header p { margin: 0; color: var(--soft); }
header .facts { font-size: 13px; margin-top: 6px; }
.badge { flex: none; padding: 7px 16px; border-radius: 999px; color: #fff; font-weight: 600;
  font-size: 14px; margin-top: 4px; background: var(--bad); }
.badge.met { background: var(--good); }
.badge.none { background: var(--soft); }
.fault { border-left: 4px solid var(--bad); background: #fdf0ee; padding: 10px 14px; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(114px, 1fr)); gap: 10px;
  margin: 22px 0 14px; }
.tile { background: var(--paper); border: 1px solid var(--line); border-radius: 8px;
  padding: 10px 11px; }
.tile span { display: block; font-size: 11.5px; color: var(--soft); white-space: nowrap; }
.tile b { font-size: 21px; font-weight: 600; font-variant-numeric: tabular-nums; }
.tile em { font-style: normal; font-size: 13px; color: var(--soft); margin-left: 3px;
  font-weight: 400; }
.tile small { display: block; color: var(--soft); font-size: 12px; }
.checks ul { list-style: none; margin: 0 0 18px; padding: 0; }
.checks li { padding: 3px 0 3px 26px; position: relative; }
.checks li::before { position: absolute; left: 2px; font-weight: 700; }
.checks li.yes::before { content: "✓"; color: var(--good); }
.checks li.no::before { content: "✗"; color: var(--bad); }
.checks li b { font-weight: 600; margin-right: 6px; }
.row { display: flex; gap: 14px; margin-bottom: 14px; }
figure { flex: 1 1 0; min-width: 0; margin: 0; background: var(--paper);
  border: 1px solid var(--line); border-radius: 8px; padding: 12px 14px; }
figure svg { width: 100%; height: auto; display: block; }
table { border-collapse: collapse; width: 100%; background: var(--paper); font-size: 13.5px;
  border: 1px solid var(--line); border-radius: 8px; }
th { text-align: left; color: var(--soft); font-weight: 600; font-size: 12.5px; }
th, td { padding: 6px 12px; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child td { border-bottom: 0; }
table.events td:first-child, table.figures td:last-child { font-variant-numeric: tabular-nums; }
details { margin-top: 14px; background: var(--paper); border: 1px solid var(--line);
  border-radius: 8px; padding: 10px 14px; }
details summary { cursor: pointer; font-weight: 600; }
details h2 { display: none; }
details table { border: 0; margin-top: 8px; }
pre { font: 12.5px/1.45 ui-monospace, "DejaVu Sans Mono", monospace; overflow-x: auto; }
@media (max-width: 760px) { .row { flex-direction: column; } header { flex-direction: column; } }
@media print { body { background: #fff; } .row, figure { break-inside: avoid; } }
"""


def small_tile(title: str, shown: str, unit: str, more: str) -> str:
    """Return a tile: a figure with its unit, and another one below it in small."""
    small = f"<small>{more}</small>" if more else ""
    return f'<div class="tile"><span>{title}</span><b>{shown}<em>{unit}</em></b>{small}</div>'


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[Any]], kind: str = "") -> str:
    """Return a table under a heading; every cell is text."""
    cells = "".join(f"<th>{html.escape(text)}</th>" for text in head)
    lines = "".join(
        "<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) + "</tr>"
        for row in rows
    )
    return (
        f'<section><h2>{html.escape(title)}</h2><table class="{kind}">'
        f"<thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table></section>"
    )
