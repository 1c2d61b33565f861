"""Both cycles of the Newcastle engine, settled at wide open throttle (thesis section 4.2)."""

from __future__ import annotations

import numpy as np

from bench.studies.atlas.entries.measures import constant_volume, middle_flatness, shape_agreement
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import printed
from bench.studies.engine.charts import pressure_volume
from bench.studies.engine.operation import BAR, Operation, operate
from bench.studies.engine.trace import Trace
from bench.web.chart import Chart, Level, Series, series, thinned
from hil.config.detailed import read
from plant.engines.detailed import layout as at
from plant.engines.detailed.figures import Figures

_TIME, _X, _V = "time from the left power stroke [ms]", "x [mm]", "velocity [m/s]"
_RISE_S = 5.0e-5


def both() -> tuple[Operation, Operation]:
    """The two-stroke and the four-stroke engine at their nominal points."""
    return operate(read("nu-two-stroke")), operate(read("nu-four-stroke"))


def by_stroke(four: Operation, column: int) -> list[float]:
    """Mean of a column of the record over the strokes 1 to 4 of the four-stroke cycle."""
    rows = four.rows
    return [float(np.mean(rows[rows[:, at.REC_PHASE] == n][:, column])) for n in range(4)]


def _durations_s(operation: Operation) -> tuple[np.ndarray, np.ndarray]:
    """Phase and duration of each stroke but the first."""
    rows = operation.rows
    return rows[1:, at.REC_PHASE], np.diff(rows[:, at.REC_T])


def _mean_durations_ms(four: Operation) -> list[float]:
    phase, lasted = _durations_s(four)
    return [1e3 * float(np.mean(lasted[phase == n])) for n in range(4)]


def _curves(two: Trace, four: Trace, x: str, y: str, fx: float, fy: float) -> tuple[Series, ...]:
    return tuple(
        thinned(series(label, fx * getattr(t, x), fy * getattr(t, y)))
        for label, t in (("two-stroke", two), ("four-stroke", four))
    )


def motion(_quick: bool) -> Found:
    """Piston motion of both cycles (Fig. 4.10)."""
    two, four = both()
    tdc = np.abs(two.rows[1:, at.REC_X])
    _, lasted = _durations_s(two)
    spread = float(np.ptp(tdc) / np.mean(tdc))
    period = float(np.ptp(lasted) / np.mean(lasted))
    durations = _mean_durations_ms(four)
    findings = {
        "F4.10-two-stroke": Finding(
            spread < 1e-2 and period < 1e-2,
            f"TDC varies by {spread:.2%}, the duration of a stroke by {period:.2%}",
        ),
        "F4.10-four-stroke": Finding(
            max(durations) > 1.2 * min(durations),
            "strokes last " + ", ".join(f"{ms:.1f}" for ms in durations) + " ms",
        ),
    }
    curves = _curves(two.trace, four.trace, "t_s", "x_m", 1e3, 1e3)
    return Found(findings, (Chart("Piston motion", _TIME, _X, curves),))


def forces(_quick: bool) -> Found:
    """Motion and machine force of the four-stroke engine (Fig. 4.11)."""
    _, four = both()
    ms, v = _mean_durations_ms(four), by_stroke(four, at.REC_V_MAX)
    area = four.engine.p[at.CYL_P + at.AREA]
    peak_n = four.figures.p_max_pa * area
    motor_n = float(np.max(np.abs(four.trace.force_n)))
    findings = {
        "F4.11-durations": Finding(
            min(ms[:2]) > 1.1 * max(ms[2:]), "strokes 1 to 4: " + _told(ms, "{:.1f}", "ms")
        ),
        "F4.11-velocity": Finding(
            min(v[2:]) > max(v[:2]), "peaks of strokes 1 to 4: " + _told(v, "{:.2f}", "m/s")
        ),
        "F4.11-peak-force": Finding(float(peak_n)),
        "F4.11-motor-force": Finding(motor_n),
    }
    t = four.trace
    charts = (
        Chart("Motion", _TIME, _X, (thinned(series("x", 1e3 * t.t_s, 1e3 * t.x_m)),)),
        Chart("Machine force", _TIME, "force [N]",
              (thinned(series("machine", 1e3 * t.t_s, t.force_n)),)),
        Chart("Gas force on the left piston", _TIME, "force [N]",
              (thinned(series("gas", 1e3 * t.t_s, area * t.p_pa)),),
              (Level("printed peak", printed("F4.11-peak-force")),)),
    )  # fmt: skip
    return Found(findings, charts)


def _told(values: list[float], form: str, unit: str) -> str:
    return ", ".join(form.format(value) for value in values) + f" {unit}"


def velocities(_quick: bool) -> Found:
    """Velocity over displacement of both cycles (Fig. 4.12)."""
    two, four = both()
    cycle, v = four.engine.calibration.cycle, by_stroke(four, at.REC_V_MAX)
    alike = shape_agreement(two.trace, four.trace)
    flat = middle_flatness(two.trace)
    v_two = two.figures.v_max_m_s
    findings = {
        "F4.12-similar": Finding(alike > 0.95, f"correlation of the shapes {alike:.3f}"),
        "F4.12-plateau": Finding(
            flat > 0.8, f"within 5 mm of mid-stroke no less than {flat:.0%} of the peak"
        ),
        "F4.12-expansion-faster": Finding(v[2] > v_two, f"peaks {v[2]:.2f} and {v_two:.2f} m/s"),
        "F4.12-nonpower-slower": Finding(
            max(v[:2]) < 0.7 * min(v[2:]), "peaks of strokes 1 to 4: " + _told(v, "{:.2f}", "m/s")
        ),
        "F4.12-turn-stroke-1": Finding(1e3 * cycle.switch_1_m),
        "F4.12-turn-stroke-4": Finding(1e3 * cycle.switch_4_m),
    }
    curves = _curves(two.trace, four.trace, "x_m", "v_m_s", 1e3, 1.0)
    return Found(findings, (Chart("Velocity over displacement", _X, _V, curves),))


def diagrams(_quick: bool) -> Found:
    """Pressure over volume of both cycles (Fig. 4.13, section 4.2.2)."""
    two, four = both()
    near = [constant_volume(o.engine, o.trace) for o in (two, four)]
    peaks = [o.figures.p_max_pa / BAR for o in (two, four)]
    rise = [float(np.max(np.diff(o.trace.p_pa))) / _RISE_S / BAR * 1e-3 for o in (two, four)]
    f2, f4 = two.figures, four.figures
    findings = {
        "F4.13-constant-volume": Finding(
            near[0] < near[1],
            f"heat is released at {near[0]:.2f} and {near[1]:.2f} times the least volume",
        ),
        "F4.13-peak-lower": Finding(
            peaks[0] < peaks[1], f"two-stroke {peaks[0]:.1f}, four-stroke {peaks[1]:.1f} bar"
        ),
        "S4.2.2-rise": Finding(
            rise[1] > rise[0], f"two-stroke {rise[0]:.0f}, four-stroke {rise[1]:.0f} bar/ms"
        ),
        "S4.2.2-four-stroke-peak": Finding(peaks[1]),
        "S4.2.2-four-stroke-cr": Finding(f4.compression_ratio),
        "S4.2.2-power-lower": Finding(
            f4.indicated_w < 0.5 * f2.indicated_w and f4.efficiency > f2.efficiency,
            f"{f4.indicated_w:.0f} W of {f2.indicated_w:.0f}, "
            f"{f4.efficiency:.1%} against {f2.efficiency:.1%}",
        ),
        "F4.17-area": _areas(two, four),
    }
    curves = tuple(thinned(pressure_volume(name, o.trace))
                   for name, o in (("two-stroke", two), ("four-stroke", four)))  # fmt: skip
    chart = Chart("Left cylinder", "volume [cm³]", "pressure [bar]", curves)
    return Found(findings, (chart,))


def _areas(two: Operation, four: Operation) -> Finding:
    area = [float(np.trapezoid(o.trace.p_pa, o.trace.volume_m3)) for o in (two, four)]
    return Finding(area[1] > area[0], f"two-stroke {area[0]:.1f}, four-stroke {area[1]:.1f} J")


def _column(f: Figures, cycle: str) -> dict[str, Finding]:
    ours = {
        "speed": f.speed_rpm, "velocity": f.v_max_m_s, "peak-pressure": f.p_max_pa / BAR,
        "fuel": f.fuel_kg_kwh, "efficiency": 100.0 * f.efficiency, "cr": f.compression_ratio,
    }  # fmt: skip
    return {f"T4.3-{cycle}-{name}": Finding(value) for name, value in ours.items()}


def performance(_quick: bool) -> Found:
    """Table 4.3; four cylinders are two engines side by side, and the mass is the other column's.

    Power over the printed ratio is a mass only in kW/kg, so that is the unit held against.
    """
    two, four = both()
    f2, f4 = two.figures, four.figures
    findings = _column(f2, "two-stroke") | _column(f4, "four-stroke")
    findings["T4.3-two-stroke-indicated"] = Finding(f2.indicated_w)
    findings["T4.3-two-stroke-electric"] = Finding(f2.electric_w)
    for cylinders in (2, 4):
        count = cylinders // 2
        for name, value in (("indicated", f4.indicated_w), ("electric", f4.electric_w)):
            findings[f"T4.3-four-stroke-{name}-{cylinders}"] = Finding(count * value)
    mass_4 = _mass_kg("T4.3-four-stroke-indicated-2", "T4.3-four-stroke-specific-2")
    mass_2 = _mass_kg("T4.3-two-stroke-indicated", "T4.3-two-stroke-specific")
    told = "in kW/kg, of an engine of {:.1f} kg, which the other cycle's column makes it"
    findings["T4.3-two-stroke-specific"] = Finding(
        1e-3 * f2.indicated_w / mass_4, told.format(mass_4)
    )
    for n in ("2", "4"):
        findings[f"T4.3-four-stroke-specific-{n}"] = Finding(
            1e-3 * f4.indicated_w / mass_2, told.format(mass_2 * int(n) / 2)
        )
    return Found(findings)


def _mass_kg(power: str, specific: str) -> float:
    """The engine's mass that a column of Table 4.3 implies."""
    return printed(power) / (1e3 * printed(specific))


def shares(_quick: bool) -> Found:
    """Where the indicated power goes (Fig. 4.14)."""
    two, four = both()
    names = ("electric_w", "friction_w", "motoring_w")
    part = [[100.0 * getattr(o.figures, n) / o.figures.indicated_w for n in names]
            for o in (two, four)]  # fmt: skip
    findings = {
        "F4.14-friction-low": Finding(
            max(part[0][1], part[1][1]) < 10.0,
            f"two-stroke {part[0][1]:.1f} %, four-stroke {part[1][1]:.1f} %",
        ),
        "F4.14-compensation": Finding(part[1][2]),
    }
    curves = tuple(series(n.removesuffix("_w"), (2.0, 4.0), (part[0][k], part[1][k]), "both")
                   for k, n in enumerate(names))  # fmt: skip
    chart = Chart("Shares of the indicated power", "strokes of the cycle", "share [%]", curves)
    return Found(findings, (chart,))


ENTRIES = (
    Entry("F4.10", "Piston motion of both cycles", ("F4.10-*",), motion),
    Entry("F4.11", "Motion and machine force, four-stroke", ("F4.11-*",), forces),
    Entry("F4.12", "Velocity over displacement, both cycles", ("F4.12-*",), velocities),
    Entry("F4.13", "Pressure over volume, both cycles",
          ("F4.13-*", "S4.2.2-rise", "S4.2.2-four-*", "S4.2.2-power-lower", "F4.17-area"),
          diagrams),
    Entry("T4.3", "Performance of both cycles", ("T4.3-*",), performance, "hil engine table"),
    Entry("F4.14", "Shares of the indicated power", ("F4.14-*",), shares),
)  # fmt: skip
