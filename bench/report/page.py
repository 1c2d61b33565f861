"""Tables and tiles of a page, and which figures stand at the top of a report."""

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
    Tile("Electric power, run", "electric_power_mean_w", "W", "{:.0f}", 1.0,
         "electric_energy_j", "{:.0f} J in all"),
    Tile("IMEP", "imep_bar", "bar", "{:.2f}", 1.0,
         "indicated_power_mean_w", "{:.0f} W indicated"),
    Tile("Fuel consumption", "brake_fuel_kg_kwh", "g/kWh", "{:.0f}", 1e3,
         "indicated_fuel_kg_kwh", "indicated {:.3f} kg/kWh"),
    Tile("Plant late p99", "plant_late_p99_us", "µs", "{:.0f}", 1.0,
         "plant_late_max_us", "max {:.0f} µs"),
    Tile("Answered in time", "answered_next_tick_share", "%", "{:.2f}", 100.0,
         "plant_missed_ticks", "{} ticks missed"),
    Tile("Times real time", "speed_sim_s_per_wall_s", "×", "{:.1f}", 1.0,
         "simulated_s", "{:g} s simulated"),
)  # fmt: skip


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
        f'<section><h2>{html.escape(title)}</h2><div class="scroll"><table class="{kind}">'
        f"<thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table></div></section>"
    )
