"""What `hil what-if` shows: both runs side by side, in figures and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from bench.judge.response import BAND_MM, response, settled_after_s
from bench.judge.strokes import Strokes, read_truth, set_points
from bench.logs.what_if.continuation import Told
from hil import log as logs
from hil.log import Log, Span

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE_S, _AFTER_S = 0.06, 0.20


def show(console: Console, told: Told) -> None:
    """Draw both runs, print the figures of both from the tick on at which they may differ."""
    picture = told.continued / "what-if.svg"
    with (
        logs.open(told.recorded / "plant.mcap") as a,
        logs.open(told.recorded / "controller.mcap") as a_controller,
        logs.open(told.continued / "plant.mcap") as b,
        logs.open(told.continued / "controller.mcap") as b_controller,
    ):
        tdc_ref_m = told.scenario.controller.tdc_ref_m
        recorded = read_truth(a, tdc_ref_m, set_points(a_controller)).strokes
        continued = read_truth(b, tdc_ref_m, set_points(b_controller)).strokes
        for note in told.notes:
            console.print(f"  note: {note}", style="dim")
        figure = _draw(told, recorded, continued, a, b)
        _save(figure, picture)
    console.print(_table(told, recorded, continued))
    console.print(f"continued from tick {told.tick}, {told.ticks} ticks: {told.continued}")
    console.print(f"picture: {picture}")


def _table(told: Told, recorded: Strokes, continued: Strokes) -> Table:
    start_ns = told.tick * told.scenario.loop.period_ns
    table = Table(box=None, padding=(0, 2, 0, 2), header_style="dim")
    for title in ("", "recorded", "what if"):
        table.add_column(title, justify="left" if not title else "right")
    both = [strokes.since(start_ns) for strokes in (recorded, continued)]
    table.add_row("strokes", *[str(len(s.t_ns)) for s in both])
    table.add_row("largest TDC error [mm]", *[_extreme(s) for s in both])
    table.add_row("last TDC [mm]", *[_last(s.tdc_m) for s in both])
    table.add_row("last fuel [mg]", *[_last(s.fuel_kg * 1e3) for s in both])
    table.add_row(f"within {BAND_MM:g} mm after [ms]", *[_settled(s, start_ns) for s in both])
    return table


def _extreme(strokes: Strokes) -> str:
    if not len(strokes.t_ns):
        return "-"
    worst = strokes.error_m[np.argmax(np.abs(strokes.error_m))]
    return f"{worst * 1e3:+.3f}"


def _last(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    return f"{values[-1] * 1e3:.4f}" if len(values) else "-"


def _settled(strokes: Strokes, start_ns: int) -> str:
    found = settled_after_s(response(strokes, start_ns))
    return "not" if found is None else f"{found * 1e3:.1f}"


def _draw(told: Told, recorded: Strokes, continued: Strokes, a: Log, b: Log) -> Figure:
    from bench.report.style import AFTER, MOTION, WANTED, WIDE, canvas

    figure, (above, middle, below) = canvas(WIDE, 8.0, rows=3, height_ratios=(1.1, 1.0, 0.9))
    start_s = told.tick * told.scenario.loop.period_ns * 1e-9
    span = Span(round(max(start_s - _BEFORE_S, 0.0) * 1e9), round((start_s + _AFTER_S) * 1e9))
    for log, colour, label, wide in ((a, MOTION, "recorded", 2.2), (b, AFTER, "what if", 1.1)):
        rows = log.array("/truth", span)
        above.plot(rows["t_ns"] * 1e-9, rows["x_m"] * 1e3, color=colour, label=label, lw=wide)
    for strokes, colour, size in ((recorded, MOTION, 5.0), (continued, AFTER, 3.0)):
        middle.plot(strokes.t_s, strokes.tdc_m * 1e3, "o-", color=colour, ms=size, lw=0.8)
        below.step(strokes.t_s, strokes.fuel_kg * 1e6, where="post", color=colour, lw=1.1)
    middle.step(recorded.t_s, recorded.tdc_ref_m * 1e3, color=WANTED, lw=0.9, ls=(0, (5, 3)))
    titles = ("Piston position", "Top dead centre, as distance from mid-stroke", "Fuel burnt")
    labels = ("x  [mm]", "TDC  [mm]", "m  [mg]")
    for axes, title, label in zip((above, middle, below), titles, labels, strict=True):
        axes.axvline(start_s, color=WANTED, lw=0.9)
        axes.set_title(title)
        axes.set_ylabel(label)
        axes.set_xlabel("t  [s]")
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    return figure


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path)
