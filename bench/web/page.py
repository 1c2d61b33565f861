"""One file that needs nothing else: style, plotting library, drawing module, arrays and text."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from bench.web.columns import Columns
from bench.web.plot import TIME, Mark, Plot, described
from hil.errors import MissingExtraError

_OURS = Path(__file__).parent


class Library(NamedTuple):
    """uPlot as its authors ship it, with their notice at its top."""

    script: str
    style: str


@cache
def library() -> Library:
    """Return uPlot's script and style out of the installed package `uplot-python`.

    The package itself is not imported: only the two files that it carries are used.

    Raises: MissingExtraError when it is not installed
    """
    found = find_spec("uplot")
    if found is None or found.origin is None:
        raise MissingExtraError("uplot-python", "desk", "a page with plots")
    static = Path(found.origin).parent / "static"
    texts = [(static / name).read_text("utf-8") for name in ("uPlot.iife.js", "uPlot.min.css")]
    return Library(*texts)


def own(name: str) -> str:
    """Return a file of ours: plot.js, style.css, the panel's."""
    return (_OURS / name).read_text("utf-8")


class Page:
    """A page in the making: text as HTML, and plots where they are to stand."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._columns = Columns()
        self._plots: list[dict[str, Any]] = []
        self._marks: list[Mark] = []

    def figure(self, plot: Plot) -> str:
        """Take a plot; returns the element in which it will be drawn."""
        self._plots.append(described(plot, self._columns))
        if plot.group == TIME:
            self._marks += [mark for mark in plot.marks if mark.label]
        name = html.escape(plot.title, quote=True)
        return f'<figure data-plot="{len(self._plots) - 1}" aria-label="{name}"></figure>'

    def row(self, plots: Sequence[Plot | None]) -> str:
        """Take plots that stand beside one another; those that are None are left out."""
        drawn = [self.figure(plot) for plot in plots if plot is not None]
        return f'<div class="row">{"".join(drawn)}</div>' if drawn else ""

    def html(self, body: str, extra: str = "") -> str:
        """Return the whole page.

        Parameters: extra : a script of the page's own, run after the plots are described

        Raises: MissingExtraError without uPlot
        """
        sheet = json.dumps({**self._columns.packed(), "plots": self._plots}, ensure_ascii=False)
        start = "Plots.page(JSON.parse(document.getElementById('sheet').textContent));"
        arrays = f'<script type="application/json" id="sheet">{_inside(sheet)}</script>'
        return _whole(self._title, body + arrays, f"{start}Plots.controls();{extra}")


def panel_page(title: str) -> str:
    """Return the page of the panel.

    Raises: MissingExtraError without uPlot
    """
    return _whole(title, own("panel.html"), own("panel.js"), own("panel.css"))


def _whole(title: str, body: str, script: str, style: str = "") -> str:
    uplot = library()
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">'
        f"<title>{html.escape(title)}</title><style>{uplot.style}</style>"
        f"<style>{own('style.css')}{style}</style></head><body><main>{body}</main>"
        f"<script>{uplot.script}</script><script>{own('plot.js')}</script>"
        f"<script>{script}</script></body></html>\n"
    )


def _inside(text: str) -> str:
    """JSON that cannot end the element in which it stands."""
    return text.replace("<", "\\u003c")


def controls(
    group: str, marks: Sequence[Mark] = (), before: float = 0.1, after: float = 0.45
) -> str:
    """Return the buttons of a group of plots, with its marks as places to go to."""
    acts = (("out", "−", "zoom out"), ("in", "+", "zoom in"), ("left", "◀", "earlier"),
            ("right", "▶", "later"), ("whole", "whole", "the whole run"))  # fmt: skip
    buttons = [
        f'<button data-act="{act}" title="{title}">{sign}</button>' for act, sign, title in acts
    ]
    places = {mark.label: mark.x for mark in reversed(marks) if mark.label}
    buttons += [
        f'<button data-go="{max(x - before, 0.0):.6f} {x + after:.6f}">'
        f"{html.escape(label)}</button>"
        for label, x in sorted(places.items(), key=lambda item: item[1])
    ]
    hint = "drag: zoom · click: cursors A and B · double click: whole"
    return f'<nav data-group="{group}">{"".join(buttons)}<small>{hint}</small></nav>'
