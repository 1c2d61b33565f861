"""The Newcastle engine motored at constant speed (thesis section 4.1)."""

from __future__ import annotations

import numpy as np

from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import printed
from bench.studies.engine.charts import pressure_volume
from bench.studies.engine.operation import BAR, motored
from bench.studies.engine.trace import cycle
from bench.web.chart import Chart, Level, series, thinned
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import strokes

_TIME = "time [ms]"


def motoring(_quick: bool) -> Found:
    """Velocity, displacement and cylinder pressure in motoring (Figs 4.7 to 4.9)."""
    engine, motion = motored()
    c = engine.calibration
    rows = strokes(motion)[-4:]
    last = rows[-1]
    trace = cycle(engine, motion)
    gap_m = c.left.length_m - abs(float(last[at.REC_X]))
    ratio = (c.cycle.exhaust_closes_m or 0.0) / gap_m
    peak_bar = float(max(last[at.REC_P_LEFT], last[at.REC_P_RIGHT])) / BAR
    stroke_s = float(np.mean(np.diff(rows[:, at.REC_T])))
    turning_s = 2.0 * c.cycle.speed_m_s / c.cycle.acceleration_m_s2
    held = float(np.mean(np.abs(np.abs(trace.v_m_s) - c.cycle.speed_m_s) < 2e-3))
    findings = {
        "F4.7-velocity": Finding(
            held > 0.98, f"at ±200 mm/s within 2 mm/s for {held:.1%} of the time"
        ),
        "F4.8-displacement": Finding(
            bool(np.all(np.abs(np.abs(rows[:, at.REC_X]) - c.cycle.turn_at_m) < 5e-5)),
            "turns within 0.05 mm of ±18 mm; the measured curve is not printed",
        ),
        "F4.8-tdc-gap": Finding(1e3 * gap_m),
        "F4.8-cr": Finding(ratio),
        "F4.9-peak": Finding(peak_bar, "the leak is calibrated on it"),
        "F4.9-peak-equal": Finding(
            abs(peak_bar / printed("F4.9-peak") - 1.0) < 0.02, f"{peak_bar:.2f} bar, so tuned"
        ),
        "S4.1.2-acceleration-share": Finding(100.0 * turning_s / stroke_s),
    }
    t_ms = 1e3 * trace.t_s
    charts = (
        Chart("Velocity", _TIME, "velocity [mm/s]",
              (thinned(series("model", t_ms, 1e3 * trace.v_m_s)),)),
        Chart("Displacement", _TIME, "x [mm]", (thinned(series("model", t_ms, 1e3 * trace.x_m)),)),
        Chart("Pressure of the left cylinder", _TIME, "pressure [bar]",
              (thinned(series("model", t_ms, trace.p_pa / BAR)),),
              (Level("measured peak", printed("F4.9-peak")),)),
        Chart("Pressure over volume", "volume [cm³]", "pressure [bar]",
              (thinned(pressure_volume("model", trace)),)),
    )  # fmt: skip
    return Found(findings, charts)


ENTRIES = (
    Entry("F4.8", "Motored at constant speed: velocity, displacement, pressure",
          ("F4.7-*", "F4.8-displacement", "F4.8-tdc-gap", "F4.8-cr", "F4.9-peak*", "S4.1.2-*"),
          motoring),
)  # fmt: skip
