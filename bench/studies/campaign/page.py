"""The page of a campaign: its table, its distributions, and the worst runs."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from bench.studies.campaign import table
from bench.studies.campaign.config import Campaign
from bench.studies.campaign.run import Row
from bench.studies.compare_page import colour_of
from bench.web.page import Page
from bench.web.plot import Plot, Series
from hil.files import Output

_DISTRIBUTIONS: Final = {
    "peak_mm": "Peak TDC error  [mm]",
    "settling_mean_ms": "Settling of the mean of ten strokes  [ms]",
    "sigma_mm": "Scatter before the disturbance  [mm]",
}


def write_page(campaign: Campaign, rows: Sequence[Row], file: Output) -> None:
    """Write the page.

    Raises: MissingExtraError when the plotting library is not installed
    """
    page = Page(campaign.name)
    plots = [_distribution(campaign, rows, key, title) for key, title in _DISTRIBUTIONS.items()]
    body = [
        f"<header><div><h1>{html.escape(campaign.name)}</h1>",
        f"<p>{html.escape(table.title(campaign, rows))}</p></div></header>",
        _table(campaign, rows),
        "<h2>Share of runs up to a value</h2>",
        *(page.row([plot]) for plot in plots),
        _worst(campaign, rows),
    ]
    file.write(page.html("".join(body)))


def _table(campaign: Campaign, rows: Sequence[Row]) -> str:
    head = "".join(f"<th>{html.escape(text)}</th>" for text in table.HEAD)
    lines = []
    for law in campaign.controllers:
        cells = table.cells(law, table.of_law(rows, law))
        lines.append("".join(f'<td class="number">{html.escape(cell)}</td>' for cell in cells))
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return (
        f'<section><div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}'
        f"</tbody></table></div><p>{html.escape(table.LEGEND)}</p></section>"
    )


def _worst(campaign: Campaign, rows: Sequence[Row]) -> str:
    items = "".join(
        f'<tr><td><a href="worst/{command.split("/")[1].split()[0]}">{html.escape(told)}</a></td>'
        f"<td><code>{html.escape(command)}</code></td></tr>"
        for told, command in table.worst_runs(campaign, rows)
    )
    return f'<section><h2>Worst runs</h2><div class="scroll"><table>{items}</table></div></section>'


def _distribution(campaign: Campaign, rows: Sequence[Row], key: str, title: str) -> Plot:
    """The cumulative distribution of a figure, a line a law; what never settled is no step."""
    series = []
    for law in campaign.controllers:
        values = [row[key] for row in table.of_law(rows, law) if not math.isnan(row[key])]
        known = np.sort([value for value in values if math.isfinite(value)])
        share = np.arange(1, len(known) + 1) / max(len(values), 1)
        series.append(Series(law, known, share, colour_of(law), "steps", width=1.8))
    return Plot(title.partition("  ")[0], title, "share of runs", tuple(series), None, low=0.0,
                high=1.02, height=260)  # fmt: skip
