"""Table and pictures of a comparison, after thesis Figs 6.7 to 6.10, 6.12 and 6.13."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

from bench.judge.response import BAND_MM, Response
from bench.report.page import STYLE
from bench.studies.compare import MOMENTS, NO_CONTROL, Cell, Comparison
from controller.motion.laws import LAWS
from hil.errors import MissingExtraError
from hil.files import Output

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_UNCONTROLLED = "#b9c0ca"
_PALETTE = ("#1f5fa8", "#8a94a6", "#0f8b8d", "#b5651d", "#7a4fa3", "#2a9d6f", "#9c2f6b", "#5d7a1f")
BOUND, BAND = "#c0392b", "#2a9d6f"
_SHOWN_S = 0.35


def table(found: Comparison) -> str:
    """Peak and settling of every law at every moment, in Markdown, the bounds first."""
    plant = found.scenario.plant
    lines = [f"# {found.scenario.name}: {plant.prototype.upper()}, {plant.model}, TDC"
             f" {1e3 * found.scenario.controller.tdc_ref_m:g} mm", "",
             "Peak TDC error [mm] / settling to +-0.1 mm [ms]", ""]  # fmt: skip
    columns = [(load, moment) for load in found.loads for moment in MOMENTS]
    lines.append(_row("", [f"{100 * (load - 1):+.0f} % {moment}" for load, moment in columns]))
    lines.append(_row("---", ["---"] * len(columns)))
    for knowledge, title in (("full", "bound"), ("mid-stroke", "bound, mid-stroke knowledge")):
        bounds = [found.bounds.get((load, m, knowledge)) for load, m in columns]
        lines.append(_row(title, [_pair(b) for b in bounds]))
    for law in found.laws:
        cells = [found.cells[law, load, moment] for load, moment in columns]
        lines.append(_row(law, [_told(cell) for cell in cells]))
    notes = {f"{c.law}: {c.note}" for c in found.cells.values() if c.note}
    return "\n".join([*lines, "", *sorted(notes)]).rstrip() + "\n"


def _row(first: str, cells: list[str]) -> str:
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
    """Write the page with its pictures.

    Raises: MissingExtraError when matplotlib is not installed
    """
    try:
        pictures = draw(found)
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] != "matplotlib":
            raise
        raise MissingExtraError("matplotlib", "desk", "the pictures of a comparison") from None
    figures = "".join(f'<div class="row"><figure>{p}</figure></div>' for p in pictures)
    title = html.escape(f"Comparison: {found.scenario.name}")
    file.write(
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body><main><h1>{title}</h1>"
        f"<pre>{html.escape(table(found))}</pre>{figures}</main></body></html>\n"
    )


def draw(found: Comparison) -> list[str]:
    """Every picture as SVG."""
    from bench.report.style import style, svg

    with style():
        figures = [_responses(found, load) for load in found.loads]
        figures.append(_fuel(found, found.loads[0]))
        figures += [_moments(found, law, found.loads[0]) for law in found.laws if law != NO_CONTROL]
        return [svg(figure) for figure in figures]


def _responses(found: Comparison, load: float) -> Figure:
    """TDC error of all laws after one step, before and after mid-stroke (Figs 6.7, 6.9, 6.10)."""
    from bench.report.style import WIDE, canvas

    figure, panels = canvas(WIDE, 7.2, rows=2, sharex=True)
    for axes, moment in zip(panels, ("a", "b"), strict=True):
        for law in found.laws:
            cell = found.cells[law, load, moment]
            _line(axes, cell.response.times_s, cell.response.errors_mm, colour_of(law), law)
        _bound_line(axes, found.bounds.get((load, moment, "full")))
        _dress(axes, f"Load {100 * (load - 1):+.0f} % at moment {moment}")
    panels[0].legend(loc="lower right", ncols=4, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    panels[-1].set_xlabel("time after the step  [ms]")
    return figure


def _fuel(found: Comparison, load: float) -> Figure:
    """Fuel burnt at each dead centre after the step (Fig 6.8)."""
    from bench.report.style import WIDE, canvas

    figure, (axes,) = canvas(WIDE, 3.8)
    for law in found.laws:
        cell = found.cells[law, load, "a"]
        _line(axes, cell.response.times_s, cell.fuel_mg, colour_of(law), law)
    bound = found.bounds.get((load, "a", "full"))
    if bound is not None:
        _line(axes, bound.times_s, [1e6 * m for m in bound.fuel_kg], BOUND, "bound")
    axes.set_xlim(0.0, 1e3 * _SHOWN_S)
    axes.set_title(f"Fuel after {100 * (load - 1):+.0f} % load at moment a")
    axes.set_ylabel("fuel  [mg]")
    axes.set_xlabel("time after the step  [ms]")
    axes.legend(loc="lower right", ncols=4, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    return figure


def _moments(found: Comparison, law: str, load: float) -> Figure:
    """One law at the four moments (Fig 6.12 for the cascade, 6.13 for the single loop)."""
    from bench.report.style import HALF, canvas

    figure, (axes,) = canvas(2.0 * HALF, 3.4)
    styles = {"a": "-", "b": "-", "c": "--", "d": "--"}
    colours = {"a": colour_of(law), "b": BOUND, "c": "#d9730d", "d": "#3d4451"}
    for moment in MOMENTS:
        response = found.cells[law, load, moment].response
        axes.plot([1e3 * t for t in response.times_s], response.errors_mm, styles[moment],
                  marker="o", markersize=3.0, color=colours[moment], label=moment)  # fmt: skip
    _dress(axes, f"{law}: {100 * (load - 1):+.0f} % at the moments a to d")
    axes.set_xlabel("time after the step  [ms]")
    axes.legend(loc="upper right", ncols=4)
    return figure


def colour_of(law: str) -> str:
    """A law's colour is that of its row among the laws, in every picture."""
    controlled = [name for name in LAWS if name != NO_CONTROL]
    if law == NO_CONTROL:
        return _UNCONTROLLED
    return _PALETTE[controlled.index(law) % len(_PALETTE)]


def _line(axes: Axes, times_s: object, values: object, colour: str, label: str) -> None:
    times = [1e3 * t for t in times_s]  # type: ignore[attr-defined]
    axes.plot(times, values, "-o", markersize=3.0, color=colour, label=label)  # type: ignore[arg-type]


def _bound_line(axes: Axes, bound: Response | None) -> None:
    if bound is not None:
        axes.plot([1e3 * t for t in bound.times_s], bound.errors_mm, ":s", color=BOUND,
                  markersize=5.0, markerfacecolor="none", label="physical bound")  # fmt: skip


def _dress(axes: Axes, title: str) -> None:
    axes.axhspan(-BAND_MM, BAND_MM, color=BAND, alpha=0.16, lw=0)
    axes.set_xlim(0.0, 1e3 * _SHOWN_S)
    axes.set_title(title)
    axes.set_ylabel("TDC error  [mm]")
