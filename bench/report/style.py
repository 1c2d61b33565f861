"""How every picture of a report looks: colours with one meaning each, thin lines, units on axes."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bench.judge.figures import RunData
from hil.config.resolved import Resolved
from hil.wire.commands import TimedCommand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOTION = "#1f5fa8"
AFTER = "#d9730d"
WANTED = "#3d4451"
BAND = "#2a9d6f"
EVENT = "#c0392b"
LEFT, RIGHT = "#1f5fa8", "#d9730d"
P_TERM, I_TERM = "#0f8b8d", "#b5651d"
COMMANDED = "#8a94a6"
PROCESS = {"plant": "#1f5fa8", "controller": "#0f8b8d"}

_RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "axes.labelsize": 9.0,
    "axes.labelcolor": "#3d4451",
    "axes.edgecolor": "#aab2bf",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e8ebf0",
    "grid.linewidth": 0.8,
    "xtick.color": "#5b6472",
    "ytick.color": "#5b6472",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.3,
    "svg.fonttype": "path",
    "svg.hashsalt": "fpeg-hil",
    "path.simplify": True,
}

WIDE, HALF = 11.0, 5.4

_LABEL_LINES = 3
_LABEL_SHARE = 0.0085  # width of a character as a share of a wide picture


@contextmanager
def style() -> Iterator[None]:
    """Draw in the report's style inside this context."""
    import matplotlib as mpl

    with mpl.rc_context(_RC):
        yield


def canvas(width: float, height: float, rows: int = 1, **layout: Any) -> tuple[Figure, list[Axes]]:  # noqa: ANN401
    """Return an empty figure and its axes from top to bottom."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(rows, 1, squeeze=False, **layout)
    return figure, [row[0] for row in grid]


_MOST_POINTS = 8_000
_DPI = 144  # of those images


def svg(figure: Figure, *, transparent: bool = True) -> str:
    """Return the figure as an SVG element, the same for the same figure."""
    _flatten_long(figure)
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=transparent, dpi=_DPI)
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _flatten_long(figure: Figure) -> None:
    """Thin out what has more points than a drawing can show; areas become images."""
    for axes in figure.axes:
        for line in axes.lines:
            x, y = (np.asarray(values) for values in line.get_data(orig=True))
            if len(x) > _MOST_POINTS:
                kept = extremes(y, _MOST_POINTS // 2)
                line.set_data(x[kept], y[kept])
        for collection in axes.collections:
            corners = [np.shape(path.vertices)[0] for path in collection.get_paths()]
            points = max(np.shape(collection.get_offsets())[0], sum(corners))
            collection.set_rasterized(points > _MOST_POINTS)


def extremes(values: NDArray[np.float64], bins: int) -> NDArray[np.intp]:
    """Return where the least and the greatest value of each of so many stretches lie."""
    edges = np.linspace(0, len(values), bins + 1).astype(np.intp)
    least = [a + int(np.argmin(values[a:b])) for a, b in pairwise(edges.tolist()) if b > a]
    most = [a + int(np.argmax(values[a:b])) for a, b in pairwise(edges.tolist()) if b > a]
    return np.unique(np.array([*least, *most], dtype=np.intp))


def describe_event(name: str, event: TimedCommand) -> str:
    """Return a few words that say what an event does."""
    if event.kind == "load-scale":
        return f"{name} × {event.number('value'):g}"
    if event.kind == "efficiency":
        return f"{name} {event.number('low') * 100:g}–{event.number('high') * 100:g} %"
    if event.kind == "misfire":
        return f"{name}: no {event.text('cause')}"
    if event.kind == "sensor-fault":
        return f"{name}: {event.text('signal')} {event.text('substitute')}"
    return name


def _description(scenario: Resolved, name: str) -> str:
    """Describe an event, or what a stimulus does."""
    if name in scenario.events:
        return describe_event(name, scenario.events[name])
    given = scenario.stimuli[name]
    if given.command is not None:
        return describe_event(name, given.command)
    return f"{name}: {given.kind}"


def event_marks(data: RunData) -> list[tuple[float, str]]:
    """Return instant [s] and label of each event; events of one instant share a label."""
    marks: dict[float, list[str]] = {}
    for instant in data.instants:
        if instant.t_ns is not None:
            label = _description(data.scenario, instant.name)
            marks.setdefault(instant.t_ns * 1e-9, []).append(label)
    return [(t_s, ", ".join(labels)) for t_s, labels in sorted(marks.items())]


def mark_events(axes: Axes, marks: Sequence[tuple[float, str]], *, labelled: bool = False) -> None:
    """Draw a line at each event inside the axes, its label at the top where there is room."""
    low, high = axes.get_xlim()
    taken = [low - high] * _LABEL_LINES
    for t_s, label in marks:
        if not low <= t_s <= high:
            continue
        axes.axvline(t_s, color=EVENT, linewidth=1.0, linestyle=(0, (4, 2)), zorder=1.5)
        if not labelled:
            continue
        width = _LABEL_SHARE * len(label) * (high - low)
        leans_left = t_s + width > high
        begin = t_s - width if leans_left else t_s
        line = next((n for n, end in enumerate(taken) if end <= begin), _LABEL_LINES - 1)
        taken[line] = begin + width
        _write_label(axes, t_s, label, line, leans_left=leans_left)


def _write_label(axes: Axes, t_s: float, label: str, line: int, *, leans_left: bool) -> None:
    axes.annotate(
        label,
        (t_s, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(-5 if leans_left else 5, -3 - 12 * line),
        textcoords="offset points",
        ha="right" if leans_left else "left",
        va="top",
        color=EVENT,
        fontsize=8.5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.8},
    )


def band(axes: Axes, centre: float, half_width: float, label: str | None = None) -> None:
    """Draw a set point with its band."""
    axes.axhspan(
        centre - half_width, centre + half_width, color=BAND, alpha=0.16, lw=0, label=label
    )
    axes.axhline(centre, color=WANTED, linewidth=0.9, linestyle=(0, (5, 3)))
