"""Pictures of `hil bench`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from bench.report.style import AFTER, COMMANDED, MOTION, canvas, style
from hil.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Final = {"loop": MOTION, "link": AFTER, "bare": COMMANDED, "cyclictest": COMMANDED}
_TITLES: Final = {
    "late": "Lateness of a tick against its deadline",
    "trip": "Round trip from a sample's send to its answer",
}


def write_picture(told: dict[str, Any], path: Path) -> None:
    """Draw lateness and round trips as histograms.

    Raises: MissingExtraError without matplotlib
    """
    try:
        with style():
            figure, axes = canvas(9.0, 6.4, rows=2)
            for kind, panel in zip(_TITLES, axes, strict=True):
                _draw(panel, kind, told)
            figure.savefig(path, dpi=130)
    except ImportError:
        raise MissingExtraError("matplotlib", "desk", "a picture") from None


def _draw(axes: Axes, kind: str, told: dict[str, Any]) -> None:
    for name, found in told["histograms"].items():
        which = name.split(" ", 1)[1]
        if not name.startswith(kind) or not told["samples"][name]:
            continue
        total = told["samples"][name]
        edges = found["edges_us"]
        share = [count / total for count in found["counts"]]
        p99 = told["figures_us"][name]["p99"]
        label = f"{which}, p99 {p99:.0f} µs"
        axes.stairs(share, [0.45, *edges[1:]], color=_COLOURS[which], label=label, linewidth=1.4)
    plan = told["plan"]
    axes.axvline(1e6 / plan["rate_hz"], color="#c0392b", linewidth=0.8, linestyle=":")
    axes.set(xscale="log", yscale="log", xlabel="µs", ylabel="share of ticks")
    axes.set_title(f"{_TITLES[kind]}, {plan['rate_hz']} Hz over {plan['link']}")
    axes.legend()
