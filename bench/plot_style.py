"""How every picture of a report looks: colours with one meaning each, thin lines, units on axes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bench.figures import RunData
from hil.config.plant import (
    EfficiencyEvent,
    LoadScaleEvent,
    MisfireEvent,
    SensorFaultEvent,
)
from hil.config.scenario import Event

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOTION = "#1f5fa8"
AFTER = "#d9730d"
WANTED = "#3d4451"
BAND = "#2a9d6f"
EVENT = "#c0392b"
LEFT, RIGHT = "#1f5fa8", "#7a4fa3"
P_TERM, I_TERM = "#0f8b8d", "#b5651d"
COMMANDED = "#8a94a6"
PROCESS = {"plant": "#1f5fa8", "controller": "#0f8b8d"}

_RC = {
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


def canvas(width: float, height: float, rows: int = 1, **layout: Any) -> tuple[Figure, list[Axes]]:  # noqa: ANN401
    """Return an empty figure in the report's style and its axes from top to bottom."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_RC):
        figure = Figure(figsize=(width, height), layout="constrained")
        grid = figure.subplots(rows, 1, squeeze=False, **layout)
    return figure, [row[0] for row in grid]


def svg(figure: Figure) -> str:
    """Return the figure as an SVG element, the same for the same figure."""
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context(_RC):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def describe_event(name: str, event: Event) -> str:
    """Return a few words that say what an event does."""
    if isinstance(event, LoadScaleEvent):
        return f"{name} × {event.value:g}"
    if isinstance(event, EfficiencyEvent):
        return f"{name} {event.low * 100:g}–{event.high * 100:g} %"
    if isinstance(event, MisfireEvent):
        return f"{name}: no {event.cause}"
    if isinstance(event, SensorFaultEvent):
        return f"{name}: {event.signal} {event.substitute}"
    return name


def event_marks(data: RunData) -> list[tuple[float, str]]:
    """Return instant [s] and label of each event; events of one instant share a label."""
    marks: dict[float, list[str]] = {}
    for instant in data.instants:
        if instant.t_ns is not None:
            label = describe_event(instant.name, data.scenario.events[instant.name])
            marks.setdefault(instant.t_ns * 1e-9, []).append(label)
    return [(t_s, ", ".join(labels)) for t_s, labels in sorted(marks.items())]


def mark_events(
    axes: Axes, marks: Sequence[tuple[float, str]], *, scale: float = 1.0, labelled: bool = True
) -> None:
    """Draw a line at each event inside the axes, and its label above the frame."""
    low, high = axes.get_xlim()
    for t_s, label in marks:
        place = t_s * scale
        if not low <= place <= high:
            continue
        axes.axvline(place, color=EVENT, linewidth=1.0, linestyle=(0, (4, 2)), zorder=1.5)
        if labelled:
            leans_left = place > low + 0.8 * (high - low)
            axes.annotate(
                label,
                (place, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(-4 if leans_left else 4, 3),
                textcoords="offset points",
                ha="right" if leans_left else "left",
                va="bottom",
                color=EVENT,
                fontsize=8.5,
            )


def band(axes: Axes, centre: float, half_width: float, label: str | None = None) -> None:
    """Draw a set point with its band."""
    axes.axhspan(centre - half_width, centre + half_width, color=BAND, alpha=0.16, lw=0, label=label)
    axes.axhline(centre, color=WANTED, linewidth=0.9, linestyle=(0, (5, 3)))
