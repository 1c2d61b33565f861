"""Charts in ink: the same drawings as on a page, as SVG or in a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bench.report.style import HALF, style, svg
from bench.web.chart import Chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PALETTE = ("#1f5fa8", "#d9730d", "#0f8b8d", "#7a4fa3", "#b5651d", "#2a9d6f", "#9c2f6b", "#5d7a1f")
"""Colours of curves in their order."""

LEVEL = "#c0392b"
_FORMATS = {"line": "-", "points": "o", "both": "o-", "steps": "-"}


def chart_svg(chart: Chart) -> str:
    """Return one drawing as an SVG element."""
    with style():
        return svg(_figure([chart]))


def save(charts: Sequence[Chart], path: Path) -> None:
    """Write drawings side by side into one picture."""
    with style():
        _figure(charts).savefig(path)


def _figure(charts: Sequence[Chart]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(HALF * len(charts), 3.6), layout="constrained")
    panels = figure.subplots(1, len(charts), squeeze=False)[0]
    for axes, chart in zip(panels, charts, strict=True):
        _draw(axes, chart)
    return figure


def _draw(axes: Axes, chart: Chart) -> None:
    for number, curve in enumerate(chart.series):
        axes.plot(
            curve.x, curve.y, _FORMATS[curve.mark], color=PALETTE[number % len(PALETTE)],
            markersize=4, label=curve.label,
            drawstyle="steps-post" if curve.mark == "steps" else "default",
        )  # fmt: skip
    for level in chart.levels:
        axes.axhline(level.y, color=LEVEL, linewidth=0.9, linestyle=(0, (5, 3)), label=level.label)
    axes.set(xlabel=chart.x_label, ylabel=chart.y_label, title=chart.title)
    if chart.log_x:
        axes.set_xscale("log")
    if len(chart.series) + len(chart.levels) > 1:
        axes.legend()
