"""Pictures of the engine: position, dead centres, phase portrait, fuel, load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.judge.figures import RunData, after, main_instant
from bench.judge.response import BAND_MM
from bench.judge.strokes import Floats
from bench.report.style import (
    AFTER,
    BAND,
    COMMANDED,
    EVENT,
    HALF,
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
from bench.report.traces import Traces

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
    axes.plot(traces.t_s, traces.x_m * 1e3, color=MOTION, label="position")
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
    for side, colour, label in ((-1, LEFT, "left"), (1, RIGHT, "right")):
        chosen = np.sign(strokes.x_m) == side
        axes.plot(t_s[chosen], tdc_mm[chosen], "o", color=colour, markersize=3.2, label=label)
    axes.set_xlim(0.0, max(data.truth.end_ns * 1e-9, 1e-3))
    axes.margins(y=0.12)
    axes.set_title("Top dead centre of every stroke, as distance from mid-stroke")
    axes.set_ylabel("TDC  [mm]")
    axes.set_xlabel("t  [s]")
    axes.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    mark_events(axes, event_marks(data))


def tdc_error(data: RunData) -> Figure | None:
    """TDC error about the event of the run, with its peak and its settling."""
    instant = main_instant(data)
    strokes = data.strokes
    if instant is None or instant.t_ns is None or not len(strokes.t_ns):
        return None
    figure, (axes,) = canvas(WIDE, 3.4)
    found = after(strokes, instant.t_ns)
    settling_ms = None if found["settling_s"] is None else found["settling_s"] * 1e3
    t_ms = np.multiply(strokes.t_ns - instant.t_ns, 1e-6, dtype=np.float64)
    high = max(400.0, 1.6 * (settling_ms or 0.0))
    shown = (t_ms >= -150.0) & (t_ms <= high)
    t_ms, error_mm = t_ms[shown], strokes.error_m[shown] * 1e3
    axes.vlines(t_ms, 0.0, error_mm, color=MOTION, linewidth=1.0, alpha=0.6)
    sides = np.where(strokes.x_m[shown] < 0.0, LEFT, RIGHT)
    axes.scatter(t_ms, error_mm, c=sides, s=18, zorder=3)
    band(axes, 0.0, BAND_MM)
    axes.set_xlim(-150.0, high)
    axes.margins(y=0.18)
    _annotate_response(axes, t_ms, error_mm, found["tdc_error_peak_mm"], settling_ms)
    axes.set_title(f"TDC error after {instant.name}")
    axes.set_ylabel("TDC − set point  [mm]")
    axes.set_xlabel(f"time since {instant.name}  [ms]")
    mark_events(axes, [(0.0, "")])
    return figure


def _annotate_response(
    axes: Axes, t_ms: Floats, error_mm: Floats, peak_mm: float | None, settling_ms: float | None
) -> None:
    """Write peak and settling time next to where they are, if that is shown."""
    plain = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    if settling_ms:
        axes.axvline(settling_ms, color=BAND, linewidth=1.0)
        axes.annotate(f"settled {settling_ms:.1f} ms", (settling_ms, 0.95), xytext=(5, 0),
                      xycoords=("data", "axes fraction"), textcoords="offset points",
                      va="top", color=BAND, bbox=plain)  # fmt: skip
    found = np.flatnonzero((t_ms >= 0.0) & (np.abs(error_mm) == (peak_mm or np.inf)))
    for peak in found[:1]:
        axes.annotate(f"peak {error_mm[peak]:+.3f} mm", (t_ms[peak], error_mm[peak]),
                      xytext=(8, 0), textcoords="offset points", va="center", color=WANTED,
                      bbox=plain)  # fmt: skip


def phase(data: RunData, traces: Traces) -> Figure:
    """Velocity against position, before and after the first event."""
    figure, (axes,) = canvas(HALF, 4.4)
    marks = event_marks(data)
    split_s = next((t for t, _ in marks if t > traces.window_s[0]), None)
    x_mm = traces.x_m * 1e3
    if split_s is None:
        axes.plot(x_mm, traces.v_m_s, color=MOTION, linewidth=1.0)
    else:
        before = traces.t_s <= split_s
        axes.plot(x_mm[~before], traces.v_m_s[~before], color=AFTER, linewidth=0.9, label="after")
        axes.plot(x_mm[before], traces.v_m_s[before], color=MOTION, linewidth=1.2, label="before")
        at = np.searchsorted(traces.t_s, split_s)
        if at < len(x_mm):
            axes.plot(x_mm[at], traces.v_m_s[at], "o", color=EVENT, markersize=5, label="event")
        axes.legend(loc="upper right", ncols=3, bbox_to_anchor=(1.0, 1.09), borderaxespad=0.0,
                    columnspacing=1.0, handlelength=1.4)  # fmt: skip
    axes.set_title("Phase portrait")
    axes.set_xlabel("x  [mm]")
    axes.set_ylabel("v  [m/s]")
    return figure


def fuel(data: RunData, traces: Traces) -> Figure:
    """Fuel of every combustion, commanded and burnt."""
    figure, (axes,) = canvas(HALF, 4.4)
    strokes = data.strokes
    rows = traces.strokes
    axes.step(rows["t_ns"] * 1e-9, rows["fuel_kg"] * 1e6, where="post", color=COMMANDED,
              linewidth=1.1, label="commanded")  # fmt: skip
    axes.plot(strokes.t_s, strokes.fuel_kg * 1e6, "o", color=MOTION, markersize=3.0, label="burnt")
    axes.set_xlim(0.0, max(data.truth.end_ns * 1e-9, 1e-3))
    axes.margins(y=0.12)
    axes.set_title("Fuel per stroke")
    axes.set_xlabel("t  [s]")
    axes.set_ylabel("m  [mg]")
    axes.legend(loc="upper right", ncols=2, bbox_to_anchor=(1.0, 1.09), borderaxespad=0.0)
    mark_events(axes, event_marks(data))
    return figure


def load(data: RunData, traces: Traces) -> Figure:
    """The load coefficient in force."""
    figure, (axes,) = canvas(WIDE, 2.5)
    axes.step(traces.load.t_s, traces.load.value, where="post", color=MOTION)
    axes.set_xlim(0.0, max(data.truth.end_ns * 1e-9, 1e-3))
    top = float(np.max(traces.load.value, initial=1.0))
    axes.set_ylim(0.0, 1.3 * top)
    axes.set_title("Electric load in force")
    axes.set_xlabel("t  [s]")
    axes.set_ylabel("c  [N s/m]")
    mark_events(axes, event_marks(data), labelled=True)
    return figure
