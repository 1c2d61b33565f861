"""Table and page of a comparison, after thesis Figs 6.7 to 6.10, 6.12 and 6.13."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from bench.judge.response import BAND_MM, Response
from bench.report.text_table import text_table
from bench.studies.compare import MOMENTS, NO_CONTROL, Cell, Comparison
from bench.web.page import Page, controls
from bench.web.plot import Plot, Series
from controller.motion.laws import LAWS
from hil.files import Output

_PALETTE: Final = 8
_SHOWN_MS: Final = 350.0
_GROUP: Final = "response"
_AFTER: Final = "time after the step  [ms]"


class Row(NamedTuple):
    """A row of the table: a law or a bound, and its peak and settling in each column."""

    title: str
    cells: tuple[str, ...]
    peaks: tuple[float, ...] = ()


def columns_of(found: Comparison) -> list[tuple[float, str]]:
    """Load and moment of each column."""
    return [(load, moment) for load in found.loads for moment in MOMENTS]


def rows_of(found: Comparison) -> list[Row]:
    """Every law at every moment, the bounds first."""
    columns, rows = columns_of(found), []
    for knowledge, title in (("full", "bound"), ("mid-stroke", "bound, mid-stroke knowledge")):
        bounds = [found.bounds.get((load, m, knowledge)) for load, m in columns]
        rows.append(Row(title, tuple(_pair(b) for b in bounds)))
    for law in found.laws:
        cells = [found.cells[law, load, moment] for load, moment in columns]
        peaks = tuple(cell.response.peak_mm for cell in cells)
        rows.append(Row(law, tuple(_told(cell) for cell in cells), peaks))
    return rows


def _titles(found: Comparison) -> list[str]:
    return [f"{100 * (load - 1):+.0f} % {moment}" for load, moment in columns_of(found)]


def _subject(found: Comparison) -> str:
    plant, controller = found.scenario.plant, found.scenario.controller
    return (f"{found.scenario.name}: {plant.prototype.upper()}, {plant.model}, TDC"
            f" {1e3 * controller.tdc_ref_m:g} mm")  # fmt: skip


def table(found: Comparison) -> str:
    """Peak and settling of every law at every moment, in Markdown, the bounds first."""
    titles = _titles(found)
    lines = [f"# {_subject(found)}", "", "Peak TDC error [mm] / settling to +-0.1 mm [ms]", "",
             _row("", titles), _row("---", ["---"] * len(titles))]  # fmt: skip
    lines += [_row(row.title, row.cells) for row in rows_of(found)]
    return "\n".join([*lines, "", *_notes(found)]).rstrip() + "\n"


def told(found: Comparison) -> str:
    """The same for a terminal: a table a load step, so that no row is too long for one."""
    lines = [_subject(found), "Peak TDC error [mm] / settling to +-0.1 mm [ms]"]
    titles, rows, width = _titles(found), rows_of(found), len(MOMENTS)
    for first in range(0, len(titles), width):
        part = slice(first, first + width)
        lines += ["", text_table([("", *titles[part]), *((r.title, *r.cells[part]) for r in rows)])]
    return "\n".join([*lines, "", *_notes(found)]).rstrip()


def _notes(found: Comparison) -> list[str]:
    return sorted({f"{c.law}: {c.note}" for c in found.cells.values() if c.note})


def _row(first: str, cells: Sequence[str]) -> str:
    return f"| {first} | " + " | ".join(cells) + " |"


def _pair(bound: Response | None) -> str:
    return "-" if bound is None else f"{bound.peak_mm:.3f} / {_ms(bound.settling_ms)}"


def _told(cell: Cell) -> str:
    if not cell.response.errors_mm:
        return "-"
    return f"{cell.response.peak_mm:.3f} / {_ms(cell.response.settling_ms)}"


def _ms(value: float) -> str:
    return "never" if math.isinf(value) else f"{value:.0f}"


def write_page(found: Comparison, file: Output) -> None:
    """Write the page with its plots.

    Raises: MissingExtraError when the plotting library is not installed
    """
    title = f"Comparison: {found.scenario.name}"
    page = Page(title)
    plots = [_responses(found, load, moment) for load in found.loads for moment in ("a", "b")]
    plots.append(_fuel(found, found.loads[0]))
    laws = [law for law in found.laws if law != NO_CONTROL]
    moments = [_moments(found, law, found.loads[0]) for law in laws]
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in _notes(found))
    body = [
        f"<header><div><h1>{html.escape(title)}</h1><p>{html.escape(_subject(found))}</p>",
        f"<p>Moments {_moments_told()}</p></div></header>",
        _table(found),
        f"<ul>{notes}</ul>" if notes else "",
        controls(_GROUP),
        *(page.row([plot]) for plot in plots),
        *(page.row(moments[i : i + 2]) for i in range(0, len(moments), 2)),
    ]
    file.write(page.html("".join(body)))


def _moments_told() -> str:
    told = (f"{m}: stroke {n}, at {share:g} of it" for m, (n, share) in MOMENTS.items())
    return "; ".join(told)


def _table(found: Comparison) -> str:
    """The table with the least peak of each column set off."""
    rows = rows_of(found)
    peaks = [row.peaks for row in rows if row.peaks]
    least = [min((p for p in column if not math.isnan(p)), default=math.nan)
             for column in zip(*peaks, strict=True)]  # fmt: skip
    head = "".join(f"<th>{html.escape(text)}</th>" for text in ("", *_titles(found)))
    lines = []
    for row in rows:
        best = [bool(row.peaks) and row.peaks[i] == least[i] for i in range(len(row.cells))]
        cells = "".join(
            f'<td class="number{" best" if first else ""}">{html.escape(cell)}</td>'
            for cell, first in zip(row.cells, best, strict=True)
        )
        lines.append(f"<tr><th>{html.escape(row.title)}</th>{cells}</tr>")
    return (
        "<section><h2>Peak TDC error [mm] / settling to ±0.1 mm [ms]</h2>"
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}'
        "</tbody></table></div></section>"
    )


def _band() -> Series:
    ends = (0.0, _SHOWN_MS)
    return Series(f"± {BAND_MM:g} mm", ends, [-BAND_MM] * 2, "band", "area", y2=[BAND_MM] * 2)


def _curve(response: Response, values: Sequence[float], colour: str, label: str) -> list[Series]:
    """A line with a dot at every dead centre."""
    times = [1e3 * t for t in response.times_s]
    dots = Series("", times, values, colour, "points", of=label)
    return [Series(label, times, values, colour), dots]


def _responses(found: Comparison, load: float, moment: str) -> Plot:
    """TDC error of all laws after one step (Figs 6.7, 6.9, 6.10)."""
    series = [_band()]
    for law in found.laws:
        response = found.cells[law, load, moment].response
        series += _curve(response, response.errors_mm, colour_of(law), law)
    bound = found.bounds.get((load, moment, "full"))
    if bound is not None:
        times = [1e3 * t for t in bound.times_s]
        series.append(Series("physical bound", times, bound.errors_mm, "event", "points",
                             shape="square", size=4.5))  # fmt: skip
    return Plot(f"Load {100 * (load - 1):+.0f} % at moment {moment}", _AFTER, "TDC error  [mm]",
                tuple(series), _GROUP, extent=(0.0, _SHOWN_MS), height=300)  # fmt: skip


def _fuel(found: Comparison, load: float) -> Plot:
    """Fuel burnt at each dead centre after the step (Fig 6.8)."""
    series: list[Series] = []
    for law in found.laws:
        cell = found.cells[law, load, "a"]
        series += _curve(cell.response, cell.fuel_mg, colour_of(law), law)
    bound = found.bounds.get((load, "a", "full"))
    if bound is not None:
        series += _curve(bound, [1e6 * m for m in bound.fuel_kg], "event", "physical bound")
    return Plot(f"Fuel after {100 * (load - 1):+.0f} % load at moment a", _AFTER, "fuel  [mg]",
                tuple(series), _GROUP, extent=(0.0, _SHOWN_MS), height=260)  # fmt: skip


def _moments(found: Comparison, law: str, load: float) -> Plot:
    """One law at the four moments (Fig 6.12 for the cascade, 6.13 for the single loop)."""
    colours = {"a": colour_of(law), "b": "event", "c": "after", "d": "wanted"}
    series = [_band()]
    for moment in MOMENTS:
        response = found.cells[law, load, moment].response
        series += _curve(response, response.errors_mm, colours[moment], moment)
    return Plot(f"{law}: {100 * (load - 1):+.0f} % at the moments a to d", _AFTER,
                "TDC error  [mm]", tuple(series), _GROUP, extent=(0.0, _SHOWN_MS))  # fmt: skip


def colour_of(law: str) -> str:
    """A law's colour is that of its row among the laws, in every plot."""
    controlled = [name for name in LAWS if name != NO_CONTROL]
    if law == NO_CONTROL:
        return "uncontrolled"
    place = controlled.index(law) if law in controlled else len(controlled)
    return f"law{place % _PALETTE}"
