"""Plots of a detailed engine's cycle: pressure-volume diagrams, and where the power goes."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from bench.web.plot import Plot, Series

if TYPE_CHECKING:
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


def pressure_volume(cycle: Cycle) -> Plot:
    """Pressure over volume of both cylinders, as in thesis Fig 4.13."""
    return Plot("Pressure and volume, last cycle", "V  [cm³]", "p  [bar]", _curves(cycle), None,
                low=0.0, square=True, height=330)  # fmt: skip


def pressure_volume_log(cycle: Cycle) -> Plot:
    """The same on logarithmic axes: gas exchange becomes visible, polytropes are straight."""
    return Plot("The same, logarithmic", "V  [cm³]", "p  [bar]", _curves(cycle), None,
                square=True, log_x=True, log_y=True, height=330)  # fmt: skip


def _curves(cycle: Cycle) -> tuple[Series, ...]:
    # In symmetric running the two lie on one another: the left one is drawn broad, below.
    return tuple(
        Series(name, cycle.volume_m3[side] * _CM3, cycle.p_pa[side] * _BAR, name, "curve",
               width=width)
        for side, name, width in ((0, "left", 4.0), (1, "right", 1.4))
        # not a chamber that is open to the air in all but name
        if cycle.volume_m3[side].max() >= _BARELY * cycle.volume_m3[side].min()
    )  # fmt: skip


def parts_of(figures: Any) -> list[Part]:  # noqa: ANN401
    """From the fuel to the indicated power, and on to the electric power (thesis eq. 4.1)."""
    f = figures
    parts = [
        Part("fuel", f.fuel_w, "wanted", remains=True),
        Part("exhaust less intake", f.exhaust_w, "commanded"),
        Part("heat to the walls", f.heat_w, "event"),
        Part("past the rings", f.leak_w, "p-term"),
        Part("indicated", f.indicated_w, "motion", remains=True),
        Part("scavenging pumps", f.pump_w, "p-term"),
        Part("friction", f.friction_w, "i-term"),
        Part("motor's drive", f.motoring_w, "right"),
        Part("copper", f.copper_w, "event"),
        Part("electric", f.electric_w, "band", remains=True),
    ]
    return [p for p in parts if p.remains or abs(p.power_w) > _SHOWN_SHARE * f.fuel_w]


def power(cycle: Cycle) -> str:
    """Where the fuel's power goes, as HTML: every loss takes its part off what is left."""
    fuel = cycle.figures.fuel_w or 1.0
    left, rows = fuel, []
    for part in parts_of(cycle.figures):
        if part.remains:
            left = part.power_w
        begin = 0.0 if part.remains else left - part.power_w
        start, share = 100.0 * min(begin, left) / fuel, 100.0 * part.power_w / fuel
        place = f"left:{start:.2f}%;width:{abs(share):.2f}%"
        told = f"{part.power_w:.0f} W · {share:.1f} %"
        rows.append(
            f"<span>{html.escape(part.name)}</span><div><i "
            f'style="{place};background:var(--{part.colour})"></i></div><output>{told}</output>'
        )
        left = part.power_w if part.remains else begin
    return (
        "<figure><figcaption><b>Power from the fuel to the terminals, share of the fuel</b>"
        f'</figcaption><div class="bars">{"".join(rows)}</div></figure>'
    )
