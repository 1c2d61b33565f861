"""Charts on a page: the same drawings, to zoom into."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

from bench.web.chart import Chart, Level, Series
from bench.web.plot import Plot
from bench.web.plot import Series as Curve

_COLOURS: Final = tuple(f"law{n}" for n in (0, 3, 2, 4, 5, 6, 7, 1))
_HEIGHT: Final = 280


def plot_of(chart: Chart) -> Plot:
    """Return a chart as a plot with a zoom of its own."""
    curves: list[Curve] = []
    for number, one in enumerate(chart.series):
        curves += _curves(one, _COLOURS[number % len(_COLOURS)])
    ends = _ends(chart)
    curves += [_level(level, ends) for level in chart.levels]
    turned = any(not _rises(one) for one in chart.series)
    return Plot(chart.title, chart.x_label, chart.y_label, tuple(curves), None, extent=ends,
                square=turned or None, log_x=chart.log_x or None, height=_HEIGHT)  # fmt: skip


def _curves(one: Series, colour: str) -> Iterator[Curve]:
    if one.mark in {"line", "both"}:
        yield Curve(one.label, one.x, one.y, colour, "line" if _rises(one) else "curve")
    if one.mark == "steps":
        yield Curve(one.label, one.x, one.y, colour, "steps")
    if one.mark == "both":
        yield Curve("", one.x, one.y, colour, "points", of=one.label)
    if one.mark == "points":
        yield Curve(one.label, one.x, one.y, colour, "points")


def _level(level: Level, ends: tuple[float, float]) -> Curve:
    return Curve(level.label, ends, (level.y, level.y), "event", dash=True)


def _rises(one: Series) -> bool:
    return all(a <= b for a, b in pairwise(one.x))


def _ends(chart: Chart) -> tuple[float, float]:
    every = [x for one in chart.series for x in one.x]
    return min(every, default=0.0), max(every, default=1.0)
