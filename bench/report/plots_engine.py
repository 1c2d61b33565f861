"""Pictures of a detailed engine's cycle: pressure-volume diagrams, and where the power goes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

from bench.report.style import (
    BAND,
    COMMANDED,
    EVENT,
    HALF,
    I_TERM,
    LEFT,
    MOTION,
    P_TERM,
    RIGHT,
    WANTED,
    WIDE,
    canvas,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bench.report.indicator import Cycle

_CM3, _BAR = 1.0e6, 1.0e-5
_BARELY: Final = 1.5
_SHOWN_SHARE: Final = 5.0e-4


class Part(NamedTuple):
    """One step of the way from the fuel to the electric power."""

    name: str
    power_w: float
    colour: str
    remains: bool = False


def pressure_volume(cycle: Cycle) -> Figure:
    """Pressure over volume of both cylinders, as in thesis Fig 4.13."""
    figure, (axes,) = canvas(HALF, 4.4)
    _draw(axes, cycle)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_title("Pressure and volume, last cycle")
    return figure


def pressure_volume_log(cycle: Cycle) -> Figure:
    """The same on logarithmic axes: gas exchange becomes visible, polytropes are straight."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure, (axes,) = canvas(HALF, 4.4)
    _draw(axes, cycle)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.set_title("The same, logarithmic")
    return figure


def _draw(axes: Axes, cycle: Cycle) -> None:
    # In symmetric running the two lie on one another: the left one is drawn broad, below.
    for side, colour, label, width in ((0, LEFT, "left", 2.6), (1, RIGHT, "right", 0.9)):
        if cycle.volume_m3[side].max() < _BARELY * cycle.volume_m3[side].min():
            continue  # a chamber that is open to the air in all but name
        axes.plot(cycle.volume_m3[side] * _CM3, cycle.p_pa[side] * _BAR, color=colour,
                  linewidth=width, alpha=0.55 if side == 0 else 1.0, label=label)  # fmt: skip
    axes.set_xlabel("V  [cm³]")
    axes.set_ylabel("p  [bar]")
    axes.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def parts_of(figures: Any) -> list[Part]:  # noqa: ANN401
    """From the fuel to the indicated power, and on to the electric power (thesis eq. 4.1)."""
    f = figures
    parts = [
        Part("fuel", f.fuel_w, WANTED, remains=True),
        Part("exhaust less intake", f.exhaust_w, COMMANDED),
        Part("heat to the walls", f.heat_w, EVENT),
        Part("past the rings", f.leak_w, P_TERM),
        Part("indicated", f.indicated_w, MOTION, remains=True),
        Part("scavenging pumps", f.pump_w, P_TERM),
        Part("friction", f.friction_w, I_TERM),
        Part("motor's drive", f.motoring_w, RIGHT),
        Part("copper", f.copper_w, EVENT),
        Part("electric", f.electric_w, BAND, remains=True),
    ]
    return [p for p in parts if p.remains or abs(p.power_w) > _SHOWN_SHARE * f.fuel_w]


def power(cycle: Cycle) -> Figure:
    """Where the fuel's power goes: every loss takes its part off what is left."""
    parts = parts_of(cycle.figures)
    fuel = cycle.figures.fuel_w or 1.0
    figure, (axes,) = canvas(WIDE, 0.34 * len(parts) + 1.1)
    left = fuel
    for row, part in enumerate(parts):
        if part.remains:
            left = part.power_w
        begin = 0.0 if part.remains else left - part.power_w
        axes.barh(row, part.power_w, left=begin, color=part.colour, height=0.66,
                  alpha=1.0 if part.remains else 0.75)  # fmt: skip
        end = max(begin + part.power_w, begin)
        text = f"{part.power_w:.0f} W   {100.0 * part.power_w / fuel:.1f} %"
        axes.annotate(text, (end, row), xytext=(6, 0), textcoords="offset points", va="center",
                      fontsize=8.5, color=WANTED)  # fmt: skip
        left = begin
        if part.remains:
            left = part.power_w
    axes.set_yticks(range(len(parts)), [part.name for part in parts])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.16 * fuel)
    axes.grid(visible=False, axis="y")
    axes.set_title("Power from the fuel to the terminals, share of the fuel")
    axes.set_xlabel("P  [W]")
    return figure
