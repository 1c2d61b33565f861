"""The Beijing engine started by mechanical resonance (Appendix I, sections 3.2 and 4.1)."""

from __future__ import annotations

import numpy as np

from bench.studies.atlas.entries.disturbances import course_of
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import printed
from bench.studies.engine.charts import starting_chart
from bench.studies.engine.operation import BAR, started, starting_peaks
from bench.studies.engine.sweep import STARTING_FORCES_N, starting_study
from bench.web.chart import Chart, Level, series
from hil.config.detailed import Calibration, ideal, read
from plant.engines.detailed import layout as at
from plant.engines.detailed.types import Array

_NAME, _FORCE_N, CYCLES = "bit-starting", 110.0, 6
READY_BAR, _HALF_SECOND = 10.0, 0.5


def _rights(rows: Array) -> Array:
    """The strokes that end a compression of the left cylinder: right peaks of a cycle are whole."""
    found: Array = rows[rows[:, at.REC_X] < 0.0]
    return found


def peaks_of(name: str, force_n: float) -> tuple[Array, Array]:
    """Times [s] and peak pressures [bar] of the right cylinder."""
    rows = _rights(started(read(name), force_n))
    return rows[:, at.REC_T], rows[:, at.REC_P_RIGHT] / BAR


def pressure_histories(_quick: bool) -> Found:
    """Ideal and full model beside the printed peaks (App. I Fig. 6)."""
    c = read(_NAME)
    every = started(ideal(c), _FORCE_N)
    full, perfect = _rights(started(c, _FORCE_N)), _rights(every)
    bars = [rows[:, at.REC_P_RIGHT] / BAR for rows in (full, perfect)]
    model = float(bars[0][full[:, at.REC_T] <= _HALF_SECOND][-1])
    early = every[every[:, at.REC_T] <= _HALF_SECOND]
    best = float(np.max(early[:, [at.REC_P_LEFT, at.REC_P_RIGHT]])) / BAR
    settled_bar = float(bars[0][-1])
    findings = {
        "A1-F6-ideal-peak": Finding(best, "the highest of either cylinder within half a second"),
        "A1-F6-model-peak": Finding(model, f"in the end {settled_bar:.1f} bar"),
        "A1-F6-time": Finding(
            float(full[np.argmax(bars[0] >= 0.97 * settled_bar), at.REC_T]),
            "until the model's peak is within 3 % of its last",
        ),
        "A1-F6-stable": Finding(
            bool(np.all(np.diff(bars[0][:5]) > 0.0)) and abs(bars[0][-1] / bars[0][-4] - 1) < 0.01,
            "the peaks rise for five cycles and settle within 1 %",
        ),
        "A1-S5-start-peak": Finding(settled_bar),
        "A1-S5-start-error": _error(settled_bar),
        "A1-abs-pressure-error": _error(settled_bar),
    }
    curves = (series("with leakage and heat to the wall", full[:, at.REC_T], bars[0], "both"),
              series("ideal", perfect[:, at.REC_T], bars[1], "both"))  # fmt: skip
    levels = (Level("printed, ideal", printed("A1-F6-ideal-peak")),
              Level("printed, measured", printed("A1-F6-test-peak")))  # fmt: skip
    chart = Chart("Started with 110 N", "time [s]", "peak pressure [bar]", curves, levels)
    return Found(findings, (chart,))


def _error(settled_bar: float) -> Finding:
    """Distance of the final peak from the one number that is printed of the measurement."""
    measured = printed("A1-F6-test-peak")
    return Finding(abs(settled_bar - measured), "of the last peak; the cycles' are not printed")


def compression(_quick: bool) -> Found:
    """Compression ratio of the first six cycles, both cylinders (App. I Fig. 8)."""
    c = read(_NAME)
    rows = started(c, _FORCE_N)
    length, closes = c.left.length_m, c.cycle.exhaust_closes_m or 0.0
    ratio = closes / (length - np.abs(rows[:, at.REC_X]))
    right, left = ratio[rows[:, at.REC_X] > 0.0], ratio[rows[:, at.REC_X] < 0.0]
    first, sixth = float(right[0]), float(right[CYCLES - 1])
    pairs = ((first, "A1-F8-cr-first"), (sixth, "A1-F8-cr-sixth"))
    error = 100.0 * max(abs(ours / printed(name) - 1.0) for ours, name in pairs)
    n = min(len(left), len(right), CYCLES)
    findings = {
        "A1-F8-cr-first": Finding(first),
        "A1-F8-cr-sixth": Finding(sixth),
        "A1-F8-error": Finding(error, "at the two cycles whose ratios are printed"),
        "A1-F8-both": Finding(
            bool(np.all(np.diff(left[:n]) > 0.0) and np.all(np.diff(right[:n]) > 0.0)),
            f"rises to {left[n - 1]:.1f} in the left and {right[n - 1]:.1f} in the right one",
        ),
    }
    cycles = np.arange(1, n + 1)
    curves = (series("left", cycles, left[:n], "both"), series("right", cycles, right[:n], "both"))
    levels = (Level("printed, first", printed("A1-F8-cr-first")),
              Level("printed, sixth", printed("A1-F8-cr-sixth")))  # fmt: skip
    chart = Chart("Started with 110 N", "cycle", "compression ratio", curves, levels)
    return Found(findings, (chart,))


def forces(_quick: bool) -> Found:
    """Peak pressure over the cycles with four forces (App. I Fig. 10)."""
    peaks = starting_study()
    times, bars = peaks_of(_NAME, 130.0)
    early = bars[times <= _HALF_SECOND]
    c = read(_NAME)
    findings = {
        "A1-F10-cycles-130": Finding(_cycle_of(peaks[130.0])),
        "A1-F10-cycles-110": Finding(_cycle_of(peaks[110.0])),
        "A1-F10-90-fails": Finding(
            max(peaks[70.0] + peaks[90.0]) < READY_BAR,
            f"highest {max(peaks[70.0]):.1f} bar at 70 N, {max(peaks[90.0]):.1f} bar at 90 N",
        ),
        "A1-F10-force-peak": _monotonic(peaks),
        "A1-F10-stable": Finding(
            float(max(_stable(p) for p in peaks.values())), "until within 5 % of the last peak"
        ),
        "A1-F10-peak-130": Finding(
            peaks[130.0][-1], f"in the end; {early[-1]:.1f} bar within half a second"
        ),
        "A1-F10-time-130": Finding(
            float(times[np.argmax(bars >= 0.95 * bars[-1])]), "until within 5 % of the last peak"
        ),
        "A1-F10-target-cr": Finding(_ratio_at(c, _FORCE_N, READY_BAR)),
        "A1-F10-cr-130": Finding(_ratio_at(c, 130.0, 0.999 * peaks[130.0][-1])),
    }
    return Found(findings, (starting_chart(peaks),))


def _cycle_of(bars: list[float]) -> float | None:
    """The first cycle whose peak makes the engine ready for ignition."""
    return next((float(n) for n, p in enumerate(bars, 1) if p >= READY_BAR), None)


def _monotonic(peaks: dict[float, list[float]]) -> Finding:
    finals = [peaks[force][-1] for force in STARTING_FORCES_N]
    thirds = [peaks[force][2] for force in STARTING_FORCES_N]
    holds = finals == sorted(finals) and thirds == sorted(thirds)
    return Finding(holds, "final peaks " + ", ".join(f"{bar:.1f}" for bar in finals) + " bar")


def _stable(bars: list[float]) -> int:
    """Cycles after which no peak is further than 5 % from the last one."""
    outside = [n for n, p in enumerate(bars, 1) if abs(p / bars[-1] - 1.0) > 0.05]
    return outside[-1] + 1 if outside else 1


def _ratio_at(c: Calibration, force_n: float, bar: float) -> float:
    """Compression ratio of the first right compression whose peak reaches a pressure."""
    rows = started(c, force_n)
    closes = c.cycle.exhaust_closes_m or 0.0
    ends = rows[rows[:, at.REC_X] > 0.0]
    number = (_cycle_of(starting_peaks(force_n)) if bar == READY_BAR else float(len(ends))) or 1.0
    x = float(ends[min(int(number), len(ends)) - 1, at.REC_X])
    return closes / (c.left.length_m - x)


def handing_over(_quick: bool) -> Found:
    """From rest to running in one run: the end of starting is the beginning of running."""
    run = course_of("start", plant__model="starting", plant__prototype="bit",
                    loop__clock="lockstep")  # fmt: skip
    first = next((n for n, dc in enumerate(run.dead_centres) if dc.fuel_kg > 0.0), 0)
    told = f"{first} dead centres of motoring, then the first charge, ends {run.mode}"
    x = series("x", [1e-3 * n for n in range(0, len(run.x_m), 4)],
               [1e3 * v for v in run.x_m[::4]])  # fmt: skip
    chart = Chart("Start of the Beijing engine", "time [s]", "x [mm]", (x,))
    return Found({"A1-initial": Finding(run.mode == "generating" and first > 1, told)}, (chart,))


ENTRIES = (
    Entry("A1", "From starting to running", ("A1-initial",), handing_over,
          "hil run start --model starting", 3.0),
    Entry("A1-F6", "Pressure history in starting: ideal and full model",
          ("A1-F6-ideal-peak", "A1-F6-model-peak", "A1-F6-time", "A1-F6-stable",
           "A1-S5-start-*", "A1-abs-pressure-error"), pressure_histories),
    Entry("A1-F8", "Compression ratio of the first cycles",
          ("A1-F8-cr-*", "A1-F8-error", "A1-F8-both"), compression),
    Entry("A1-F10", "Peak pressure over the cycles with four motor forces",
          ("A1-F10-cycles-*", "A1-F10-90-fails", "A1-F10-force-peak", "A1-F10-stable",
           "A1-F10-peak-130", "A1-F10-time-130", "A1-F10-target-cr", "A1-F10-cr-130"), forces,
          "hil engine sweep --over motor-force --engine bit-starting"),
)  # fmt: skip
