"""Plots of the engine: position with its pulses, dead centres, error, fuel, pressures, machine."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from bench.judge.figures import RunData, after, main_instant
from bench.judge.response import BAND_MM
from bench.report.curves.envelope import Trace
from bench.report.curves.lines import mode_lane, pulse_lanes
from bench.report.curves.traces import Traces
from bench.report.style import event_marks
from bench.web.plot import Lane, Mark, Plot, Series

_T = "t  [s]"
SIDES = ((-1, "left", "circle"), (1, "right", "square"))


def marks_of(data: RunData) -> tuple[Mark, ...]:
    """The events of the scenario that acted."""
    return tuple(Mark(t_s, label) for t_s, label in event_marks(data))


def traced(
    label: str, trace: Trace, colour: str, scale: float, signal: str, *, steps: bool = False
) -> tuple[Series, ...]:
    """A signal: a line where every sample is there, elsewhere the range in which they lie."""
    line = Series(label, trace.t_s, trace.y * scale, colour, "steps" if steps else "line",
                  signal=signal, scale=scale)  # fmt: skip
    if not len(trace.bin_t_s):
        return (line,)
    low, high = trace.low * scale, trace.high * scale
    return line, Series("", trace.bin_t_s, low, colour, "area", y2=high, of=label)


def position(data: RunData, traces: Traces) -> Plot:
    """Piston position with the dead centres, and below it the TTL lines and the modes."""
    strokes, ends = data.strokes, (0.0, traces.end_s)
    head_mm = data.scenario.plant.resolved_prototype().half_stroke_m * 1e3
    ref_mm = (data.scenario.controller.tdc_ref_m or 0.0) * 1e3
    series = [*traced("position", traces.signals["x_m"], "motion", 1e3, "plant.truth.x_m")]
    for side, name, shape in SIDES:
        own = strokes.part(np.sign(strokes.x_m) == side)
        series.append(Series(f"dead centre {name}", own.t_s, own.x_m * 1e3, name, "points",
                             shape=shape))  # fmt: skip
        level = [side * ref_mm] * 2
        series.append(Series("set point" if side > 0 else "", ends, level, "wanted", dash=True,
                             width=1.0, of="set point"))  # fmt: skip
        series.append(Series("head" if side > 0 else "", ends, [side * head_mm] * 2, "wanted",
                             width=1.6, of="head"))  # fmt: skip
    lanes = (*pulse_lanes(traces.pulses), *_modes(traces))
    return Plot("Piston position, pulses and modes", _T, "x  [mm]", tuple(series),
                marks=marks_of(data), lanes=lanes, extent=ends, height=300)  # fmt: skip


def _modes(traces: Traces) -> tuple[Lane, ...]:
    lanes = [mode_lane("mode", traces.operating)]
    if traces.machine:
        lanes.append(mode_lane("machine", traces.machine))
    return tuple(lanes)


def dead_centres(data: RunData) -> Plot:
    """The TDC of every stroke of the run, within the band about its set point."""
    strokes = data.strokes
    ref_mm = strokes.tdc_ref_m * 1e3
    series = [
        Series(f"± {BAND_MM:g} mm", strokes.t_s, ref_mm - BAND_MM, "band", "area",
               y2=ref_mm + BAND_MM, step=True),
        Series("set point", strokes.t_s, ref_mm, "wanted", "steps", dash=True, width=1.0),
        Series("", strokes.t_s, strokes.tdc_m * 1e3, "commanded", width=0.7),
    ]  # fmt: skip
    for side, name, shape in SIDES:
        own = strokes.part(np.sign(strokes.x_m) == side)
        series.append(Series(name, own.t_s, own.tdc_m * 1e3, name, "points", shape=shape))
    return Plot("Top dead centre of every stroke, from mid-stroke", _T, "TDC  [mm]", tuple(series),
                marks=marks_of(data), extent=(0.0, data.truth.end_ns * 1e-9 or 1.0))  # fmt: skip


def tdc_error(data: RunData) -> Plot | None:
    """TDC error about the event of the run, with its peak and its settling."""
    instant = main_instant(data)
    strokes = data.strokes
    if instant is None or instant.t_ns is None or not len(strokes.t_ns):
        return None
    found = after(strokes, instant.t_ns)
    settling_ms = None if found["settling_s"] is None else found["settling_s"] * 1e3
    t_ms = np.multiply(strokes.t_ns - instant.t_ns, 1e-6, dtype=np.float64)
    ends = (-150.0, max(400.0, 1.6 * (settling_ms or 0.0)))
    band = Series(f"± {BAND_MM:g} mm", ends, [-BAND_MM] * 2, "band", "area", y2=[BAND_MM] * 2)
    series, shown = [band], (t_ms >= ends[0]) & (t_ms <= ends[1])
    error_mm = strokes.error_m * 1e3
    for side, name, shape in SIDES:
        own = shown & (np.sign(strokes.x_m) == side)
        series.append(Series(name, t_ms[own], error_mm[own], name, "stems", shape=shape, size=3.4))
    marks = [Mark(0.0, instant.name)]
    if settling_ms:
        marks.append(Mark(settling_ms, f"settled {settling_ms:.1f} ms", "band"))
    peak = np.flatnonzero(shown & (t_ms >= 0.0) & (np.abs(error_mm) == found["tdc_error_peak_mm"]))
    if len(peak):
        marks.append(Mark(t_ms[peak[0]], f"peak {error_mm[peak[0]]:+.3f} mm", "wanted"))
    return Plot(f"TDC error after {instant.name}", f"time since {instant.name}  [ms]",
                "TDC − set point  [mm]", tuple(series), None, tuple(marks),
                extent=ends)  # fmt: skip


def phase(data: RunData, traces: Traces) -> Plot:
    """Velocity against position, before and after the first event."""
    t_s, x_m = traces.within("x_m", traces.window_s)
    v_m_s = traces.within("v_m_s", traces.window_s)[1]
    start, end = (0.0, np.inf) if not len(t_s) else (t_s[0], t_s[-1])
    cuts = [t for t, _ in event_marks(data) if start < t < end][:1]
    parts = list(pairwise([0, *np.searchsorted(t_s, cuts).tolist(), len(t_s)]))
    names = ("before", "after") if cuts else ("motion",)
    series = [
        Series(name, x_m[a : b + 1] * 1e3, v_m_s[a : b + 1], colour, "curve", width=width)
        for name, colour, width, (a, b) in zip(names, ("motion", "after"), (1.6, 1.0), parts,
                                               strict=False)
    ]  # fmt: skip
    return Plot("Phase portrait", "x  [mm]", "v  [m/s]", tuple(series), None, square=True,
                height=320)  # fmt: skip


def fuel(data: RunData, traces: Traces) -> Plot:
    """Fuel of every combustion, commanded and burnt."""
    strokes, rows = data.strokes, traces.strokes
    series = [Series("commanded", rows["t_ns"] * 1e-9, rows["fuel_kg"] * 1e6, "commanded", "steps")]
    for side, name, shape in SIDES:
        own = strokes.part(np.sign(strokes.x_m) == side)
        series.append(Series(f"burnt {name}", own.t_s, own.fuel_kg * 1e6, name, "points",
                             shape=shape))  # fmt: skip
    return Plot("Fuel per stroke", _T, "m  [mg]", tuple(series), marks=marks_of(data),
                extent=(0.0, traces.end_s), height=320)  # fmt: skip


def pressures(data: RunData, traces: Traces) -> Plot | None:
    """Pressures in both cylinders, as the sensors said; None for a model without."""
    left, right = traces.signals["p_left_pa"], traces.signals["p_right_pa"]
    if not np.any(np.nan_to_num(np.concatenate([left.y, right.y]))):
        return None
    series = (
        *traced("left", left, "left", 1e-5, "plant.sensor.p_left_pa"),
        *traced("right", right, "right", 1e-5, "plant.sensor.p_right_pa"),
    )
    return Plot("Cylinder pressures", _T, "p  [bar]", series, marks=marks_of(data),
                extent=(0.0, traces.end_s), unlabelled=True)  # fmt: skip


def machine(data: RunData, traces: Traces) -> list[Plot | None]:
    """Force of the motoring machine if it ever motored, the load in force, the electric power."""
    ends, marks = (0.0, traces.end_s), marks_of(data)
    force, power = traces.signals["force_n"], traces.signals["electric_power_w"]
    pushed = None
    if np.any(np.nan_to_num(force.y)) or np.any(np.nan_to_num(force.high)):
        pushed = Plot("Machine force when motoring", _T, "F  [N]",
                      traced("force", force, "motoring", 1.0, "plant.actuator.force_n", steps=True),
                      marks=marks, lanes=(mode_lane("machine", traces.machine),), extent=ends,
                      unlabelled=True)  # fmt: skip
    load = Series("load coefficient", traces.load.t_s, traces.load.value, "motion", "steps")
    return [
        pushed,
        Plot("Electric load in force", _T, "c  [N s/m]", (load,), marks=marks, extent=ends,
             low=0.0, height=200),
        Plot("Electric power, as sensed", _T, "P  [W]",
             traced("power", power, "generating", 1.0, "plant.sensor.electric_power_w"),
             marks=marks, extent=ends, unlabelled=True, height=200),
    ]  # fmt: skip
