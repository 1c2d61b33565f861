"""Pictures of the controller and of the ticks: loop terms, lateness."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bench.judge.figures import RunData
from bench.judge.punctuality import QUANTILES
from bench.report.style import (
    HALF,
    I_TERM,
    MOTION,
    P_TERM,
    PROCESS,
    WANTED,
    WIDE,
    canvas,
    event_marks,
    mark_events,
)
from bench.report.traces import Traces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOW_NS = 100.0
_PER_DECADE = 20


def loops(data: RunData, traces: Traces) -> Figure | None:
    """Mid-stroke speed with its reference, and the terms of the outer and the inner loop."""
    rows = traces.strokes
    if not len(rows):
        return None
    figure, (speed, outer, inner) = canvas(WIDE, 7.0, rows=3, sharex=True)
    t_s = rows["t_ns"] * 1e-9
    speed.step(t_s, rows["v_ref_m_s"], where="post", color=WANTED, linewidth=1.0,
               linestyle=(0, (5, 3)), label="reference")  # fmt: skip
    speed.plot(t_s, rows["v_mid_m_s"], "o", color=MOTION, markersize=3.0, label="measured")
    speed.set_title("Speed at mid-stroke")
    speed.set_ylabel("v  [m/s]")
    speed.set_ylim(*_about(rows["v_mid_m_s"], rows["v_ref_m_s"]))
    _draw_terms(outer, t_s, rows["outer_p_m_s"] * 1e3, rows["outer_i_m_s"] * 1e3)
    outer.set_title("Outer loop: TDC error to speed reference")
    outer.set_ylabel("u  [mm/s]")
    _draw_terms(inner, t_s, rows["inner_p_kg"] * 1e6, rows["inner_i_kg"] * 1e6)
    inner.set_title("Inner loop: speed error to fuel")
    inner.set_ylabel("u  [mg]")
    inner.set_xlabel("t  [s]")
    inner.set_xlim(0.0, max(data.truth.end_ns * 1e-9, 1e-3))
    for axes in (speed, outer, inner):
        axes.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
        mark_events(axes, event_marks(data))
    return figure


def _about(*columns: NDArray[Any]) -> tuple[float, float]:
    """Limits about the values, without those of a law that has no such reference (zero)."""
    values = np.concatenate(columns)
    values = values[np.isfinite(values) & (values > 0.0)]
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = 0.12 * (high - low) or 0.05 * high
    return low - room, high + room


def _draw_terms(axes: Axes, t_s: NDArray[Any], p: NDArray[Any], i: NDArray[Any]) -> None:
    axes.step(t_s, p, where="post", color=P_TERM, label="proportional")
    axes.step(t_s, i, where="post", color=I_TERM, label="integral")
    axes.margins(y=0.14)


def lateness_histogram(data: RunData) -> Figure:
    """How late the ticks of both processes were, as shares over a logarithmic axis."""
    figure, (axes,) = canvas(HALF, 3.6)
    for name, timing in data.timing.items():
        edges_ns, counts = timing.late.rebinned(_PER_DECADE, _LOW_NS)
        edges_us = np.maximum(edges_ns, 0.5 * _LOW_NS) * 1e-3
        share = counts / max(counts.sum(), 1)
        axes.stairs(share, edges_us, color=PROCESS[name], fill=True, alpha=0.35, label=name)
        p99 = timing.late.quantile_ns(QUANTILES["p99"])
        if p99:
            axes.axvline(p99 * 1e-3, color=PROCESS[name], linewidth=1.0, linestyle=(0, (4, 2)))
    axes.set_xscale("log")
    longest_us = max(timing.late.max_ns for timing in data.timing.values()) * 1e-3
    axes.set_xlim(0.05, max(2.0 * longest_us, 1000.0))
    axes.set_title("Tick lateness (dashed: p99)")
    axes.set_xlabel("woken after due  [µs]")
    axes.set_ylabel("share of ticks")
    axes.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    return figure


def lateness_over_time(data: RunData, traces: Traces) -> Figure:
    """The latest tick of each part of the run."""
    figure, (axes,) = canvas(HALF, 3.6)
    period_us = data.scenario.loop.period_ns * 1e-3
    for name, profile in traces.lateness.items():
        floor = np.maximum(profile.max_us, 0.1)
        axes.plot(profile.t_s, floor, color=PROCESS[name], linewidth=0.9, label=name)
    axes.set_yscale("log")
    axes.axhline(period_us, color=WANTED, linewidth=0.9, linestyle=(0, (5, 3)), label="one period")
    axes.set_xlim(0.0, max(data.truth.end_ns * 1e-9, 1e-3))
    axes.set_title("Latest tick")
    axes.set_xlabel("t  [s]")
    axes.set_ylabel("woken after due  [µs]")
    axes.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    mark_events(axes, event_marks(data))
    return figure
