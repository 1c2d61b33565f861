"""What a survey found: a table for people, rows for programs, a page with both and plots."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from itertools import groupby
from textwrap import wrap
from typing import Final

from bench.report.text_table import text_table
from bench.studies.compare_page import colour_of
from bench.studies.survey import NOMINAL_HZ, Row
from bench.web.page import Page, controls
from bench.web.plot import Plot, Series
from hil.files import Output

_TITLE: Final = "Laws on engines"
_GROUP: Final = "rate"

_HEAD = (
    "engine", "rate [Hz]", "law", "peak [mm]", "settling [ms]", "bound [mm]", "bound [ms]",
    "sigma [mm]", "least sigma [mm]", "lost", "misfires",
)  # fmt: skip

_HEAD_TOLD: Final = (
    ("law", "peak", "settling", "bound", "bound", "sigma", "least", "lost", "misfires"),
    ("", "mm", "ms", "mm", "ms", "mm", "mm", "", ""),
)

LEGEND = (
    "Worst of load steps of -15 and +15 %; settling to +-0.1 mm; bound: of what the law can know;"
    " sigma: of the dead centres, efficiencies of the combustion uniform in 0.95 to 1; least sigma:"
    " that no law goes below by fuel alone. `-`: none, or never."
)


def as_json(rows: Sequence[Row]) -> str:
    """All rows as JSON: what there is not, or never comes, is null."""
    return json.dumps({"legend": LEGEND, "rows": [row._asdict() for row in rows]}, indent=1) + "\n"


def table(rows: Sequence[Row]) -> str:
    """All rows in Markdown, and why some have no figures."""
    lines = ["# Laws on engines", "", LEGEND, "", _line(_HEAD), _line(["---"] * len(_HEAD))]
    lines += [_line(_cells(row)) for row in rows]
    return "\n".join([*lines, "", *_notes(rows)]).rstrip() + "\n"


def told(rows: Sequence[Row]) -> str:
    """The same for a terminal: a table an engine and rate, so that no row is too long for one."""
    lines = [_TITLE, *wrap(LEGEND, 80)]
    for (engine, rate), group in groupby(map(_cells, rows), key=lambda cells: cells[:2]):
        lines += ["", f"{engine}, {rate} Hz", text_table([*_HEAD_TOLD, *(c[2:] for c in group)])]
    return "\n".join([*lines, "", *_notes(rows)]).rstrip()


def _notes(rows: Sequence[Row]) -> list[str]:
    return sorted({f"- {row.law}, {row.engine} {row.model}, {row.rate_hz} Hz: {row.note}"
                   for row in rows if row.note})  # fmt: skip


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _cells(row: Row) -> list[str]:
    return [
        f"{row.engine} {row.model}", str(row.rate_hz), row.law, _shown(row.peak_mm, ".3f"),
        _shown(row.settling_ms, ".0f"), _shown(row.bound_mm, ".3f"), _shown(row.bound_ms, ".0f"),
        _shown(row.sigma_mm, ".3f"), _shown(row.sigma_least_mm, ".3f"), str(row.lost),
        str(row.misfires),
    ]  # fmt: skip


def _shown(value: float | None, style: str) -> str:
    return "-" if value is None else format(value, style)


def write_page(rows: Sequence[Row], file: Output) -> None:
    """Write the page: a table a figure, settling over the rate where it varies, all rows.

    Raises: MissingExtraError when the plotting library is not installed
    """
    page = Page(_TITLE)
    nominal = [row for row in rows if row.rate_hz == NOMINAL_HZ]
    body = [f"<header><div><h1>{_TITLE}</h1><p>{html.escape(LEGEND)}</p></div></header>"]
    body += [_by_engine(nominal, *figure) for figure in _FIGURES]
    if len({row.rate_hz for row in rows}) > 1:
        body += [controls(_GROUP), *(page.row([plot]) for plot in _over_rates(rows))]
    body.append(f"<section><h2>All rows</h2><pre>{html.escape(table(rows))}</pre></section>")
    file.write(page.html("".join(body)))


_FIGURES: Final = (
    ("Peak TDC error at 1 kHz  [mm]", "peak_mm", "bound_mm", ".3f"),
    ("Settling to ±0.1 mm at 1 kHz  [ms]", "settling_ms", "bound_ms", ".0f"),
    ("Scatter under combustion noise at 1 kHz  [mm]", "sigma_mm", "sigma_least_mm", ".3f"),
)
"""Title, the figure of a row, the least that it may be, and how it is written."""


def _by_engine(rows: Sequence[Row], title: str, key: str, least: str, style: str) -> str:
    """A figure of every law on every engine, and beside it what is the least on these steps."""
    engines = list(dict.fromkeys((row.engine, row.model) for row in rows))
    head = "".join(f"<th>{html.escape(' '.join(engine))}</th>" for engine in engines)
    lines = []
    for law in dict.fromkeys(row.law for row in rows):
        mine = {(row.engine, row.model): row for row in rows if row.law == law}
        cells = "".join(
            f'<td class="number">{_shown(getattr(mine[e], key), style)} /'
            f" {_shown(getattr(mine[e], least), style)}</td>" if e in mine else "<td></td>"
            for e in engines
        )  # fmt: skip
        lines.append(f"<tr><th>{html.escape(law)}</th>{cells}</tr>")
    return (
        f"<section><h2>{title} / its bound</h2>"
        f'<div class="scroll"><table><thead><tr><th></th>{head}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div></section>"
    )


def _over_rates(rows: Sequence[Row]) -> list[Plot]:
    """Settling over the loop's rate, a plot an engine; what never settles is not in it."""
    plots = []
    for engine in dict.fromkeys((row.engine, row.model) for row in rows):
        series: list[Series] = []
        for law in dict.fromkeys(row.law for row in rows):
            known = [(1e-3 * row.rate_hz, row.settling_ms) for row in rows
                     if (row.engine, row.model, row.law) == (*engine, law)
                     and row.settling_ms is not None]  # fmt: skip
            if known:
                rates, values = zip(*known, strict=True)
                series.append(Series(law, rates, values, colour_of(law)))
                series.append(Series("", rates, values, colour_of(law), "points", of=law))
        plots.append(Plot(f"Settling on {' '.join(engine)}", "rate  [kHz]", "settling  [ms]",
                          tuple(series), _GROUP, extent=(0.0, 20.0)))  # fmt: skip
    return plots
