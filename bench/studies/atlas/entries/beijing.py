"""The Beijing engine running: part load and full throttle (Appendix I, sections 3.3 and 4.2)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bench.studies.atlas.entries.measures import constant_volume, middle_flatness, power_stroke
from bench.studies.atlas.entries.part_load import picked, rising, told
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import printed
from bench.studies.engine import charts
from bench.studies.engine.charts import pressure_volume
from bench.studies.engine.operation import BAR, Operation, operate, operation_of, part_load
from bench.studies.engine.sweep import SweepPoint, sweep
from bench.studies.engine.trace import Trace
from bench.web.chart import Chart, Level, thinned
from hil.config.detailed import read

_NAME = "bit-running"
GENERATOR = 0.90
"""Efficiency of the linear generator that section 4.3 of the appendix takes."""


@lru_cache(maxsize=1)
def study() -> tuple[SweepPoint, ...]:
    """The four loads."""
    return tuple(sweep("throttle", _NAME))


def full() -> Operation:
    """The engine at full throttle."""
    return operate(read(_NAME))


def part_load_table(_quick: bool) -> Found:
    """Velocity over displacement and performance over load (App. I Fig. 11, Table 2)."""
    points = study()
    findings: dict[str, Finding] = {}
    for point in points:
        load, f = round(100.0 * point.value), point.figures
        ours = {"peak-speed": f and f.v_max_m_s, "average-speed": f and f.v_mean_m_s,
                "equivalent-speed": f and f.speed_rpm, "cr": f and f.compression_ratio}  # fmt: skip
        for name, value in ours.items():
            findings[f"A1-T2-{name}-{load}"] = Finding(value, point.reason)
    v, cr = picked(points, lambda f: f.v_max_m_s), picked(points, lambda f: f.compression_ratio)
    traces = [p.trace for p in points if p.trace is not None]
    flat = min(middle_flatness(t) for t in traces)
    before, after = zip(*map(_accelerations, traces), strict=True)
    grows = Finding(
        rising(v) and rising(cr), told(v, "{:.2f}", "m/s, ratios ") + told(cr, "{:.1f}", "")
    )
    findings |= {
        "A1-F11-correlation": grows,
        "A1-S5-throttle": grows,
        "A1-F11-plateau": Finding(flat > 0.8, f"within 5 mm of mid-stroke {flat:.0%} of the peak"),
        "A1-F11-acceleration": Finding(
            all(b < a for b, a in zip(before, after, strict=True)),
            told(before, "{:.0f}", "before, ") + told(after, "{:.0f}", "m/s² after"),
        ),
    }
    return Found(findings, charts.charts(points, "throttle", _NAME))


def _accelerations(trace: Trace) -> tuple[float, float]:
    """Greatest acceleration just before the dead centre that ends a stroke, and just after one."""
    x, v = power_stroke(trace)
    a = np.abs(np.gradient(v, trace.t_s[: len(v)]))
    third = len(x) // 3
    return float(np.max(a[-third:])), float(np.max(a[:third]))


def full_throttle(_quick: bool) -> Found:
    """Performance at full throttle, and its pressure over volume (App. I Table 3, Fig. 12)."""
    o = full()
    f, peak = o.figures, o.figures.p_max_pa / BAR
    hz, power_kw = f.speed_rpm / 60.0, 1e-3 * f.electric_w
    efficiency = 100.0 * f.electric_w / f.fuel_w
    shaft = f"electric over fuel power; indicated {100.0 * f.efficiency:.1f} %"
    with_loss = Finding(GENERATOR * efficiency, "the efficiency, times 90 % of the generator")
    near = constant_volume(o.engine, o.trace)
    findings = {
        "A1-T3-frequency": Finding(hz),
        "A1-T3-power": Finding(power_kw),
        "A1-T3-mean-velocity": Finding(f.v_mean_m_s),
        "A1-T3-peak-velocity": Finding(f.v_max_m_s),
        "A1-T3-cr": Finding(f.compression_ratio),
        "A1-T3-efficiency": Finding(efficiency, shaft),
        "A1-S5-efficiency": Finding(efficiency, shaft),
        "A1-S4.3-speed": Finding(f.speed_rpm),
        "A1-S4.3-efficiency": with_loss,
        "A1-abs-efficiency": with_loss,
        "A1-S4.3-fpeg-power": Finding(power_kw),
        "A1-abs-power": Finding(power_kw),
        "A1-S5-frequency": Finding(hz),
        "A1-S5-peak": Finding(peak),
        "A1-F12-peak": Finding(peak),
        "A1-F12-constant-volume": Finding(
            near < 1.5, f"heat is released at {near:.2f} times the least volume in the mean"
        ),
        "A1-generator-loss": Finding(True, "the load constant takes force times speed, no more"),
        "A1-S4.3-power-lower": _below_conventional(f.electric_w),
    }
    chart = Chart("Left cylinder, full throttle", "volume [cm³]", "pressure [bar]",
                  (thinned(pressure_volume("model", o.trace)),),
                  (Level("printed peak", printed("A1-F12-peak")),))  # fmt: skip
    return Found(findings, (chart,))


def _below_conventional(bit_w: float) -> Finding:
    """Against what an engine of two such cylinders gives at 5000 rpm and the same work a charge."""
    hz = full().figures.speed_rpm / 60.0
    crank_w = bit_w * (5000.0 / 60.0) / hz
    return Finding(
        bit_w < crank_w, f"{bit_w:.0f} W; the same work a charge at 5000 rpm is {crank_w:.0f} W"
    )


def medium_throttle(_quick: bool) -> Found:
    """Pressure over volume in running (App. I Fig. 9); its throttle and curve are not printed."""
    o = operation_of(*part_load(read(_NAME), 0.75))
    chart = Chart("Left cylinder, 75 % load", "volume [cm³]", "pressure [bar]",
                  (thinned(pressure_volume("model", o.trace)),))  # fmt: skip
    return Found({}, (chart,))


ENTRIES = (
    Entry("A1-F9", "Pressure over volume in running, medium throttle", (), medium_throttle),
    Entry("A1-F11", "Velocity over displacement over load",
          ("A1-T2-*", "A1-F11-correlation", "A1-F11-plateau", "A1-F11-acceleration",
           "A1-S5-throttle"), part_load_table,
          "hil engine sweep --over throttle --engine bit-running", 2.0),
    Entry("A1-F12", "Pressure over volume and performance at full throttle",
          ("A1-T3-*", "A1-S4.3-speed", "A1-S4.3-efficiency", "A1-S4.3-fpeg-power",
           "A1-S4.3-power-lower", "A1-abs-efficiency", "A1-abs-power", "A1-S5-efficiency",
           "A1-S5-frequency", "A1-S5-peak", "A1-F12-*", "A1-generator-loss"), full_throttle),
)  # fmt: skip
