"""Plots of the controller and of the ticks: loop terms, lateness."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.judge.figures import RunData
from bench.judge.punctuality import QUANTILES
from bench.report.curves.traces import Traces
from bench.report.plots_motion import marks_of
from bench.web.plot import Mark, Plot, Series

_T = "t  [s]"
_LOW_NS = 100.0
_PER_DECADE = 20


def loops(data: RunData, traces: Traces) -> list[Plot]:
    """Mid-stroke speed with its reference, and the terms of the outer and the inner loop."""
    rows = traces.strokes
    if not len(rows):
        return []
    t_s, ends, marks = rows["t_ns"] * 1e-9, (0.0, traces.end_s), marks_of(data)
    ref = np.where(rows["v_ref_m_s"] > 0.0, rows["v_ref_m_s"], np.nan)  # a law without one: zero
    speed = [Series("reference", t_s, ref, "wanted", "steps", dash=True)]
    for number, name, shape in ((0, "left", "circle"), (1, "right", "square")):
        own = rows[rows["side"] == number]
        speed.append(Series(f"before {name}", own["t_ns"] * 1e-9, own["v_mid_m_s"], name, "points",
                            shape=shape))  # fmt: skip
    if not np.isfinite(ref).any():
        del speed[0]
    plots = [Plot("Speed at mid-stroke", _T, "v  [m/s]", tuple(speed), marks=marks, extent=ends,
                  unlabelled=True)]  # fmt: skip
    for title, unit, loop, field, scale in (
        ("Outer loop: TDC error to speed reference", "u  [mm/s]", "outer", "m_s", 1e3),
        ("Inner loop: speed error to fuel", "u  [mg]", "inner", "kg", 1e6),
    ):
        terms = _terms(rows, t_s, loop, field, scale)
        plots.append(Plot(title, _T, unit, terms, marks=marks, extent=ends, unlabelled=True))
    return plots


def _terms(rows: NDArray[Any], t_s: Any, loop: str, unit: str, scale: float) -> tuple[Series, ...]:  # noqa: ANN401
    return tuple(
        Series(label, t_s, rows[f"{loop}_{key}_{unit}"] * scale, f"{key}-term", "steps")
        for key, label in (("p", "proportional"), ("i", "integral"))
    )


def lateness_histogram(data: RunData) -> Plot:
    """How late the ticks of both processes were, as shares over a logarithmic axis."""
    series, marks = [], []
    for name, timing in data.timing.items():
        edges_ns, counts = timing.late.rebinned(_PER_DECADE, _LOW_NS)
        edges_us = np.maximum(edges_ns, 0.5 * _LOW_NS) * 1e-3
        share = np.append(counts, 0) / max(counts.sum(), 1)
        series.append(Series(name, edges_us, share, name, "steps"))
        p99 = timing.late.quantile_ns(QUANTILES["p99"])
        if p99:
            marks.append(Mark(p99 * 1e-3, f"{name} p99", name))
    longest_us = max(timing.late.max_ns for timing in data.timing.values()) * 1e-3
    return Plot("Tick lateness", "woken after due  [µs]", "share of ticks", tuple(series), None,
                tuple(marks), extent=(0.05, max(2.0 * longest_us, 1000.0)), low=0.0, log_x=True,
                height=260)  # fmt: skip


def lateness_over_time(data: RunData, traces: Traces) -> Plot:
    """The latest tick of each part of the run."""
    period_us = data.scenario.loop.period_ns * 1e-3
    ends = (0.0, traces.end_s)
    series = [
        Series(name, profile.t_s, np.maximum(profile.max_us, 0.1), name)
        for name, profile in traces.lateness.items()
    ]
    series.append(Series("one period", ends, [period_us] * 2, "wanted", dash=True, width=1.0))
    return Plot("Latest tick", _T, "woken after due  [µs]", tuple(series), marks=marks_of(data),
                extent=ends, log_y=True, unlabelled=True, height=260)  # fmt: skip
