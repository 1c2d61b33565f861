"""Drawings of the parameter studies: what the thesis draws of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from bench.studies.engine.operation import BAR
from bench.studies.engine.sweep import SWEEPS, SweepPoint
from bench.studies.engine.trace import Trace
from bench.web.chart import Chart, Level, Series, series, thinned

_POWERS = (
    ("indicated", "indicated_w"),
    ("electric", "electric_w"),
    ("friction", "friction_w"),
    ("compensation", "motoring_w"),
)
"""The indicated power and its shares (Figs 4.14 to 4.20); motoring takes the compensation."""


def charts(points: Sequence[SweepPoint], over: str, name: str) -> tuple[Chart, ...]:
    """Return what the thesis draws of a study."""
    first = {"throttle": _powers, "ignition": _pressure_volume, "motor-force": _positions,
             "load": _reach}[over]  # fmt: skip
    if over == "throttle" and name == "bit-running":
        return _velocities(points, over), _part_load(points, over)
    if over == "throttle":
        return (_powers(points, over),)
    return first(points, over), _powers(points, over)


def starting_chart(peaks: Mapping[float, Sequence[float]]) -> Chart:
    """Peak pressure of the right cylinder by cycle (App. I Fig. 10)."""
    curves = [series(f"{force:g} N", range(1, len(bars) + 1), bars, "both")
              for force, bars in peaks.items()]  # fmt: skip
    ready = Level("ready for ignition", 10.0)
    return Chart("Motored from rest", "cycle", "peak pressure [bar]", tuple(curves), (ready,))


def fuel_charts(rows: Sequence[tuple[float, float, float]]) -> tuple[Chart, Chart]:
    """TDC and speed over the fuel of the fast model (Fig. 6.2)."""
    x = [100.0 * change for change, _, _ in rows]
    tdc = series("TDC", x, [1e3 * tdc_m for _, tdc_m, _ in rows], "both")
    speed = series("speed", x, [rpm for _, _, rpm in rows], "both")
    over = "change of fuel [%]"
    head = Level("head", 20.0)
    return (Chart("Dead centre", over, "TDC [mm]", (tdc,), (head,)),
            Chart("Speed", over, "speed [rpm]", (speed,)))  # fmt: skip


def shown(over: str, value: float) -> str:
    """Say a value of a study: 20° or 85 %."""
    return f"{value:g}°" if over == "ignition" else f"{100.0 * value:g} %"


def _over(points: Sequence[SweepPoint], over: str, label: str, key: str, factor: float) -> Series:
    good = [p for p in points if p.figures is not None]
    x = [p.value if over == "ignition" else 100.0 * p.value for p in good]
    return series(label, x, [factor * getattr(p.figures, key) for p in good], "both")


def _axis(over: str) -> str:
    unit = SWEEPS[over].unit
    return f"{over} [{unit}]" if over == "ignition" else f"{over} [% {unit}]"


def _powers(points: Sequence[SweepPoint], over: str) -> Chart:
    curves = [_over(points, over, label, key, 1.0) for label, key in _POWERS]
    drawn = tuple(curve for curve in curves if any(curve.y))
    return Chart("Distribution of the indicated power", _axis(over), "power [W]", drawn)


def _reach(points: Sequence[SweepPoint], over: str) -> Chart:
    curve = _over(points, over, "TDC", "tdc_m", 1e3)
    return Chart("Dead centre at fixed fuel", _axis(over), "TDC [mm]", (curve,))


def _part_load(points: Sequence[SweepPoint], over: str) -> Chart:
    """Compression ratio and velocities (App. I Table 2)."""
    curves = (
        _over(points, over, "compression ratio", "compression_ratio", 1.0),
        _over(points, over, "peak velocity [m/s]", "v_max_m_s", 1.0),
        _over(points, over, "mean velocity [m/s]", "v_mean_m_s", 1.0),
    )
    return Chart("Performance over load", _axis(over), "", curves)


def _traces(
    points: Sequence[SweepPoint], over: str, curve: Callable[[str, Trace], Series]
) -> tuple[Series, ...]:
    """One curve a value of the study."""
    return tuple(thinned(curve(shown(over, p.value), p.trace))
                 for p in points if p.trace is not None)  # fmt: skip


def _pressure_volume(points: Sequence[SweepPoint], over: str) -> Chart:
    curves = _traces(points, over, pressure_volume)
    return Chart("Left cylinder", "volume [cm³]", "pressure [bar]", curves)


def pressure_volume(label: str, trace: Trace) -> Series:
    """A cycle's pressure in bar over its volume in cm3."""
    return series(label, 1e6 * trace.volume_m3, trace.p_pa / BAR)


def _positions(points: Sequence[SweepPoint], over: str) -> Chart:
    curves = _traces(points, over, lambda label, t: series(label, 1e3 * t.t_s, 1e3 * t.x_m))
    return Chart("Motion", "time from the left power stroke [ms]", "x [mm]", curves)


def _velocities(points: Sequence[SweepPoint], over: str) -> Chart:
    curves = _traces(points, over, lambda label, t: series(label, 1e3 * t.x_m, t.v_m_s))
    return Chart("Velocity over position", "x [mm]", "velocity [m/s]", curves)
