"""A run at a glance, for a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bench.judge.strokes import Strokes
    from bench.judge.traces import Trace


def overview(title: str, x_m: Trace, centres: Strokes) -> Figure:
    """Draw the piston, every dead centre with its set point, and the fuel, one above the other.

    Raises: MissingExtraError without matplotlib
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "desk", "a picture") from None
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    position, centre, fuel = figure.subplots(3, 1, sharex=True)
    position.plot(x_m.t_ns * 1e-9, x_m.value * 1e3, linewidth=0.5)
    position.set_ylabel("position in mm")
    centre.plot(centres.t_s, centres.tdc_m * 1e3, ".", markersize=3)
    centre.plot(centres.t_s, centres.tdc_ref_m * 1e3, linewidth=1.0)
    centre.set_ylabel("TDC in mm")
    fuel.plot(centres.t_s, centres.fuel_kg * 1e6, ".", markersize=3)
    fuel.set_ylabel("fuel in mg")
    fuel.set_xlabel("time in s")
    figure.suptitle(title)
    return figure
