"""Plots of what a law of the user's own tells of itself: its topic /law, by names and units."""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from bench.judge.figures import RunData
from bench.report.curves.traces import Traces
from bench.report.plots_motion import marks_of
from bench.run.directory import RunFiles
from bench.web.plot import Plot, Series
from hil import log as logs
from hil.log.topics import LAW
from hil.names.leaves import unit_of

_HUES: Final = ("motion", "after", "band", "spark", "p-term", "i-term", "valve", "law4")
_SHOWN: Final = {"m": ("mm", 1e3), "kg": ("mg", 1e6), "Pa": ("bar", 1e-5)}
"""By unit that in which the other plots of a report have it, and the factor."""


def told(data: RunData, traces: Traces, files: RunFiles) -> list[Plot]:
    """A plot for each unit of the signals that the law declares; none where it declares none."""
    controller = data.scenario.controller
    with logs.open(files.controller_log) as log:
        if LAW.name not in log.topics:
            return []
        rows = log.array(LAW.name)
    by_unit: dict[str, list[str]] = {}
    for name in controller.own.signals:
        if name in (rows.dtype.names or ()):
            by_unit.setdefault(unit_of(name), []).append(name)
    law = controller.own.name or controller.name
    return [_plot(law, unit, names, rows, data, traces) for unit, names in by_unit.items()]


def _plot(
    law: str, unit: str, names: list[str], rows: NDArray[Any], data: RunData, traces: Traces
) -> Plot:  # fmt: skip
    """The signals of one unit, each held until the next demand."""
    shown, factor = _SHOWN.get(unit, (unit, 1.0))
    t_s = rows["t_ns"] * 1e-9
    series = tuple(
        Series(name, t_s, rows[name] * factor, hue, "steps")
        for name, hue in zip(names, _HUES, strict=False)
    )
    return Plot(f"Law {law}: {', '.join(names)}", "t  [s]", shown and f"[{shown}]", series,
                marks=marks_of(data), extent=(0.0, traces.end_s), unlabelled=True)  # fmt: skip
