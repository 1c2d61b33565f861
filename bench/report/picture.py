"""The overview of a run as one picture: position about the event, every top dead centre."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.judge.figures import RunData
from bench.judge.response import BAND_MM
from bench.report.curves.traces import Traces
from bench.report.style import (
    BAND,
    LEFT,
    MOTION,
    RIGHT,
    WANTED,
    WIDE,
    band,
    canvas,
    event_marks,
    mark_events,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def overview(data: RunData, traces: Traces) -> Figure:
    """Piston position about the event, and the TDC of every stroke of the run."""
    figure, (above, below) = canvas(WIDE, 6.4, rows=2, height_ratios=(1.15, 1.0))
    _draw_position(above, data, traces)
    _draw_tdc(below, data)
    return figure


def _draw_position(axes: Axes, data: RunData, traces: Traces) -> None:
    ref_mm = data.scenario.controller.tdc_ref_m * 1e3
    head_mm = data.scenario.plant.resolved_prototype().half_stroke_m * 1e3
    strokes = data.strokes
    shown = (strokes.t_s >= traces.window_s[0]) & (strokes.t_s <= traces.window_s[1])
    t_s, x_m = traces.within("x_m", traces.window_s)
    axes.plot(t_s, x_m * 1e3, color=MOTION, label="position")
    axes.plot(strokes.t_s[shown], strokes.x_m[shown] * 1e3, "o", color=MOTION, markersize=3.6,
              label="dead centres")  # fmt: skip
    for side in (-1.0, 1.0):
        band(axes, side * ref_mm, BAND_MM)
        axes.axhline(side * head_mm, color=WANTED, linewidth=1.4)
    axes.annotate("cylinder heads", (0.995, head_mm), xycoords=("axes fraction", "data"),
                  xytext=(0, -3), textcoords="offset points", ha="right", va="top",
                  fontsize=8, color=WANTED)  # fmt: skip
    axes.set_xlim(*traces.window_s)
    axes.set_ylim(-1.15 * head_mm, 1.42 * head_mm)
    axes.set_title("Piston position")
    axes.set_ylabel("x  [mm]")
    axes.set_xlabel("t  [s]")
    mark_events(axes, event_marks(data), labelled=True)


def _draw_tdc(axes: Axes, data: RunData) -> None:
    strokes = data.strokes
    t_s, tdc_mm = strokes.t_s, strokes.tdc_m * 1e3
    ref_mm = strokes.tdc_ref_m * 1e3
    axes.fill_between(t_s, ref_mm - BAND_MM, ref_mm + BAND_MM, color=BAND, alpha=0.16, lw=0,
                      step="mid", label=f"± {BAND_MM:g} mm")  # fmt: skip
    axes.step(t_s, ref_mm, where="mid", color=WANTED, linewidth=0.9, linestyle=(0, (5, 3)),
              label="set point")  # fmt: skip
    axes.plot(t_s, tdc_mm, color=MOTION, linewidth=0.8, alpha=0.55)
    for side, colour, shape, label in ((-1, LEFT, "o", "left"), (1, RIGHT, "s", "right")):
        chosen = np.sign(strokes.x_m) == side
        axes.plot(t_s[chosen], tdc_mm[chosen], shape, color=colour, markersize=3.2, label=label)
    axes.set_xlim(0.0, max(data.truth.end_ns * 1e-9, 1e-3))
    axes.margins(y=0.12)
    axes.set_title("Top dead centre of every stroke, as distance from mid-stroke")
    axes.set_ylabel("TDC  [mm]")
    axes.set_xlabel("t  [s]")
    axes.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    mark_events(axes, event_marks(data))
