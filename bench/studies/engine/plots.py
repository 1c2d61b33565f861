"""Pictures of the parameter studies, in the report's style."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.report import style as look
from bench.studies.engine.sweep import SWEEPS, SweepPoint
from bench.studies.engine.tables import TABLE_2

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BAR = 1.0e5
_POWERS = (
    ("electric", "electric_w", look.MOTION),
    ("friction", "friction_w", look.AFTER),
    ("compensation", "motoring_w", look.COMMANDED),
)
"""Shares of the indicated power as in Figs 4.14 to 4.20: compensation is what motoring takes."""


def draw(points: Sequence[SweepPoint], over: str, name: str, path: Path) -> None:
    """Draw what the thesis draws of that study."""
    good = [point for point in points if point.figures is not None]
    with look.style():
        figure, axes = _two()
        if over == "throttle" and name == "bit-running":
            _velocities(axes[0], good)
            _part_load(axes[1], good)
        else:
            first = {"throttle": _powers, "ignition": _pressure_volume,
                     "motor-force": _positions, "load": _reach}[over]  # fmt: skip
            first(axes[0], good)
            _distribution(axes[1], good, over)
        figure.suptitle(name)
        figure.savefig(path)


def draw_starting(peaks: dict[float, list[float]], path: Path) -> None:
    """Peak pressure of the right cylinder by cycle (App. I Fig. 10)."""
    with look.style():
        figure, (axes,) = look.canvas(look.HALF, 3.6)
        for shade, (force, bars) in zip(_shades(len(peaks)), peaks.items(), strict=True):
            cycles = range(1, len(bars) + 1)
            axes.plot(cycles, bars, "o-", color=shade, markersize=4, label=f"{force:g} N")
        axes.axhline(10.0, color=look.WANTED, linewidth=0.9, linestyle=(0, (5, 3)))
        axes.set(xlabel="cycle", ylabel="peak pressure [bar]", title="Motored from rest")
        axes.set_ylim(bottom=0.0)
        axes.legend(title="motor force")
        figure.savefig(path)


def draw_fuel(rows: Sequence[tuple[float, float, float]], path: Path) -> None:
    """TDC and speed over the fuel of the fast model (Fig. 6.2)."""
    x = [100.0 * change for change, _, _ in rows]
    with look.style():
        figure, axes = _two()
        axes[0].plot(x, [1e3 * tdc for _, tdc, _ in rows], "o-", color=look.MOTION, markersize=4)
        axes[0].axhline(20.0, color=look.EVENT, linewidth=0.9, linestyle=(0, (5, 3)))
        axes[0].annotate("head", (x[0], 20.0), color=look.EVENT, va="bottom")
        axes[0].set(xlabel="change of fuel [%]", ylabel="TDC [mm]", title="Dead centre")
        axes[1].plot(x, [speed for _, _, speed in rows], "o-", color=look.AFTER, markersize=4)
        axes[1].set(xlabel="change of fuel [%]", ylabel="speed [rpm]", title="Speed")
        for one in axes:
            one.set_ylim(bottom=0.0)
        figure.savefig(path)


def _two() -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(look.WIDE, 4.0), layout="constrained")
    return figure, list(figure.subplots(1, 2))


def _shades(count: int) -> list[Any]:
    """Colours from early to late values."""
    import matplotlib as mpl

    return [mpl.colormaps["viridis"](0.9 * n / max(count - 1, 1)) for n in range(count)]


def _value(over: str, value: float) -> str:
    return f"{value:g}°" if over == "ignition" else f"{value:.0%}"


def _powers(axes: Axes, points: Sequence[SweepPoint]) -> None:
    x = [100.0 * p.value for p in points]
    for label, key, colour in (("indicated", "indicated_w", look.WANTED), _POWERS[0]):
        y = [getattr(p.figures, key) for p in points]
        axes.plot(x, y, "o-", color=colour, markersize=4, label=label)
    axes.set(xlabel="throttle [% of wide open]", ylabel="power [W]", title="Power")
    axes.set_ylim(bottom=0.0)
    axes.legend()


def _reach(axes: Axes, points: Sequence[SweepPoint]) -> None:
    x = [100.0 * p.value for p in points]
    tdc = [1e3 * p.figures.tdc_m for p in points if p.figures]
    axes.plot(x, tdc, "o-", color=look.MOTION, markersize=4)
    axes.set(xlabel="load [% of nominal]", ylabel="TDC [mm]", title="Dead centre at fixed fuel")


def _pressure_volume(axes: Axes, points: Sequence[SweepPoint]) -> None:
    for shade, point in zip(_shades(len(points)), points, strict=True):
        if point.trace is not None:
            volume, p = 1e6 * point.trace.volume_m3, point.trace.p_pa / _BAR
            axes.plot(volume, p, color=shade, label=_value("ignition", point.value))
    axes.set(xlabel="volume [cm³]", ylabel="pressure [bar]", title="Left cylinder")
    axes.legend(title="before TDC")


def _positions(axes: Axes, points: Sequence[SweepPoint]) -> None:
    for shade, point in zip(_shades(len(points)), points, strict=True):
        if point.trace is not None:
            t, x = 1e3 * point.trace.t_s, 1e3 * point.trace.x_m
            axes.plot(t, x, color=shade, label=_value("motor-force", point.value))
    axes.set(xlabel="time from the left power stroke [ms]", ylabel="x [mm]", title="Motion")
    axes.legend(title="motor force", loc="upper left", bbox_to_anchor=(0.2, 1.0))


def _velocities(axes: Axes, points: Sequence[SweepPoint]) -> None:
    for shade, point in zip(_shades(len(points)), points, strict=True):
        if point.trace is not None:
            x, v = 1e3 * point.trace.x_m, point.trace.v_m_s
            axes.plot(x, v, color=shade, label=_value("throttle", point.value))
    axes.set(xlabel="x [mm]", ylabel="velocity [m/s]", title="Velocity over position")
    axes.legend(title="load")


def _part_load(axes: Axes, points: Sequence[SweepPoint]) -> None:
    """Compression ratio and mean speed beside Table 2 of Appendix I."""
    x = [100.0 * p.value for p in points]
    ours = {
        "compression ratio": [p.figures.compression_ratio for p in points if p.figures],
        "peak velocity [m/s]": [p.figures.v_max_m_s for p in points if p.figures],
    }
    column = {"compression ratio": 3, "peak velocity [m/s]": 0}
    for (label, y), colour in zip(ours.items(), (look.MOTION, look.AFTER), strict=True):
        axes.plot(x, y, "o-", color=colour, markersize=4, label=label)
        printed = [row[column[label]] for row in TABLE_2.values()]
        axes.plot([100.0 * load for load in TABLE_2], printed, "x", color=colour)
    axes.set(xlabel="load [%]", ylabel="", title="Beside the printed table (crosses)")
    axes.legend()


def _distribution(axes: Axes, points: Sequence[SweepPoint], over: str) -> None:
    """Stacked shares of the indicated power."""
    places = range(len(points))
    base = [0.0] * len(points)
    for label, key, colour in _POWERS:
        part = [getattr(p.figures, key) for p in points]
        if max(part, default=0.0) > 0.0:
            axes.bar(places, part, 0.6, bottom=base, color=colour, label=label)
            base = [a + b for a, b in zip(base, part, strict=True)]
    axes.set_xticks(list(places), [_value(over, p.value) for p in points])
    axes.set(xlabel=f"{over} [{SWEEPS[over].unit}]", ylabel="power [W]",
             title="Distribution of the indicated power")  # fmt: skip
    axes.set_ylim(top=1.15 * max(base, default=1.0))
    axes.legend(loc="upper left", ncols=len(_POWERS))
    axes.grid(visible=False, axis="x")
