"""Cascade, single loop and no control after load steps (thesis section 6.2)."""

from __future__ import annotations

import math
import statistics
from functools import lru_cache

from bench.judge.response import BAND_MM
from bench.studies.atlas.entries.disturbances import course_of
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.compare import MOMENTS, NO_CONTROL, Cell, Comparison, compare
from bench.web.chart import Chart, Level, Series, series
from hil.config.prototypes import NU
from plant.engines.fast.combustion import energy_j, sine_force_n
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc

CASCADE, SINGLE = "cascade", "single-loop"
DOWN, UP = 0.85, 1.15
_SAME_KG = 1e-3
_TARGETS_W = (1200.0, 1300.0, 1400.0, 1500.0)
_TIME = "time after the step [ms]"


@lru_cache(maxsize=1)
def comparison() -> Comparison:
    """Both laws and none, on both steps, at the four moments."""
    return compare("load-decrease", (CASCADE, SINGLE))


def cell(law: str, load: float, moment: str) -> Cell:
    """One law after one step."""
    found = comparison()
    nearest = min(found.loads, key=lambda value: abs(value - load))
    return found.cells[law, nearest, moment]


def first_action(one: Cell) -> int:
    """Dead centres after the step until the fuel is another: 1 is the end of its own stroke."""
    steady = comparison().scenario.controller.preset.fuel_kg or 0.0
    changed = (n for n, mg in enumerate(one.fuel_mg, 1) if abs(mg - 1e6 * steady) > _SAME_KG)
    return next(changed, 0)


def _errors(label: str, one: Cell) -> Series:
    r = one.response
    return series(label, [1e3 * t for t in r.times_s], r.errors_mm, "both")


def _error_chart(title: str, curves: list[Series]) -> Chart:
    band = (Level("band", BAND_MM), Level("band", -BAND_MM))
    return Chart(title, _TIME, "TDC error [mm]", tuple(curves), band)


def cascade_step(load: float, figure: str) -> Found:
    """The cascade after one step: TDC (Figs 6.7, 6.9) and fuel (Fig. 6.8)."""
    cells = {moment: cell(CASCADE, load, moment) for moment in MOMENTS}
    r = cells["a"].response
    settled_s = max(c.response.settling_s() for c in cells.values())
    errors = [abs(e) for e in r.errors_mm]
    falls = errors[1] < errors[0] and first_action(cells["a"]) == 1
    told = f"peak {r.peak_mm:.3f} mm, then {errors[1]:.3f} and {errors[2]:.3f} mm"
    findings = {
        f"{figure}-settling": Finding(settled_s, "the slowest of the four moments"),
        f"{figure}-{'current-cycle' if load < 1.0 else 'recovery'}": Finding(falls, told),
    }
    curves = [_errors(moment, c) for moment, c in cells.items()]
    return Found(findings, (_error_chart(f"Cascade, load {100 * (load - 1):+.0f} %", curves),))


def decrease(_quick: bool) -> Found:
    """Cascade after -15 % (Figs 6.7, 6.8)."""
    found = cascade_step(DOWN, "F6.7")
    one = cell(CASCADE, DOWN, "a")
    low, high = min(one.fuel_mg), max(one.fuel_mg)
    steady = 1e6 * (comparison().scenario.controller.preset.fuel_kg or 0.0)
    findings = {
        **found.findings,
        "F6.8-fuel-low": Finding(low),
        "F6.8-fuel-high": Finding(max(high, steady)),
        "F6.8-first-action": Finding(
            first_action(one) == 1, f"changes at dead centre {first_action(one)} after the step"
        ),
        "F6.8-variation-small": Finding(
            (steady - low) < 0.3 * steady, f"{low:.2f} to {max(high, steady):.2f} mg"
        ),
        "S6.3-settling": found.findings["F6.7-settling"],
        "S7.1-settling": found.findings["F6.7-settling"],
        "S7.1-injector": _injector(steady),
    }
    fuel = series("cascade", [1e3 * t for t in one.response.times_s], one.fuel_mg, "steps")
    chart = Chart("Fuel after −15 % of load", _TIME, "fuel [mg]", (fuel,),
                  (Level("printed, low", 2.0), Level("printed, high", 3.0)))  # fmt: skip
    return Found(findings, (*found.charts, chart))


def _injector(steady_mg: float) -> Finding:
    """The fuel that moves TDC by the band, in the settled engine."""
    k, load = constants_of(NU, "harmonic"), NU.load_coefficient_n_s_m
    more = fuel_for_tdc(k, NU.tdc_ref_m + 1e-3 * BAND_MM, load)
    share = 1e6 * more / steady_mg - 1.0
    return Finding(share < 0.02, f"{share:.2%} of the fuel moves TDC by {BAND_MM:g} mm")


def increase(_quick: bool) -> Found:
    """Cascade after +15 % (Fig. 6.9)."""
    return cascade_step(UP, "F6.9")


def both_laws(_quick: bool) -> Found:
    """Errors of cascade, single loop and none (Fig. 6.10, Table 6.2, Fig. 6.5)."""
    cells = {law: cell(law, DOWN, "a") for law in (CASCADE, SINGLE, NO_CONTROL)}
    cascade, single = cells[CASCADE].response, cells[SINGLE].response
    acts = {law: first_action(cells[law]) for law in (CASCADE, SINGLE)}
    settle = f"{cascade.settling_ms:.0f} and {single.settling_ms:.0f} ms"
    peaks = f"{cascade.peak_mm:.3f} and {single.peak_mm:.3f} mm"
    worst = [max(range(len(r.errors_mm)), key=lambda n: abs(r.errors_mm[n])) + 1
             for r in (cascade, single)]  # fmt: skip
    quicker = Finding(
        acts[CASCADE] < acts[SINGLE],
        f"fuel changes at dead centre {acts[CASCADE]} and {acts[SINGLE]} after the step",
    )
    findings = {
        "F6.10-band": Finding(BAND_MM),
        "F6.10-peak": Finding(cascade.peak_mm < single.peak_mm, f"at moment a {peaks}"),
        "F6.10-settling": Finding(cascade.settling_ms < single.settling_ms, settle),
        "F6.10-max-first": Finding(
            max(worst) <= 2, f"largest at stroke {worst[0]} (cascade) and {worst[1]} (single loop)"
        ),
        "F6.10-cascade-first": Finding(
            abs(cascade.errors_mm[1]) < abs(cascade.errors_mm[0]),
            f"{cascade.errors_mm[0]:.3f}, then {cascade.errors_mm[1]:.3f} mm",
        ),
        "F6.10-single-second": Finding(
            abs(single.errors_mm[2]) < abs(single.errors_mm[1]) and acts[SINGLE] == 2,
            ", ".join(f"{e:.3f}" for e in single.errors_mm[:4]) + " mm",
        ),
        "F6.10-delay": quicker,
        "F6.5-correction": quicker,
        "F6.5-cascade": Finding(
            acts[CASCADE] == 1, "mid-stroke velocity of the disturbed stroke changes its fuel"
        ),
        "T6.2-delay": Finding(acts[SINGLE] / 2.0, "two strokes are a cycle"),
        "T6.2-sequence": Finding(
            acts[SINGLE] == 2, "read at the first dead centre, injected at the second"
        ),
        "T6.2-once": _once_a_stroke(),
    }
    curves = [_errors(law, c) for law, c in cells.items()]
    return Found(findings, (_error_chart("TDC error after −15 % at moment a", curves),))


def _once_a_stroke() -> Finding:
    """Whether every dead centre of a disturbed run has a charge, and one alone."""
    run = course_of("load-decrease", controller__name=SINGLE, loop__clock="lockstep",
                    run__duration_s=1.5)  # fmt: skip
    numbers = [dc.number for dc in run.dead_centres]
    whole = all(dc.fuel_kg > 0.0 for dc in run.dead_centres[1:])
    return Finding(
        whole and numbers == list(range(numbers[0], numbers[0] + len(numbers))),
        f"{len(numbers)} strokes, a charge each",
    )


def cascade_moments(_quick: bool) -> Found:
    """The cascade at the moments a to d (Figs 6.11, 6.12)."""
    cells = {moment: cell(CASCADE, DOWN, moment) for moment in MOMENTS}
    peaks = {m: c.response.peak_mm for m, c in cells.items()}
    acts = {m: first_action(c) for m, c in cells.items()}
    slowest = max(c.response.settling_s() for c in cells.values())
    early, late = max(peaks["a"], peaks["c"]), min(peaks["b"], peaks["d"])
    told = ", ".join(f"{m} {p:.3f}" for m, p in peaks.items()) + " mm"
    findings = {
        "F6.12-settling": Finding(slowest, "the slowest of the four moments"),
        "F6.12-early-lower": Finding(early < late, told),
        "F6.12-difference-small": Finding(
            late - early < 0.02 * 1e3 * comparison().scenario.controller.tdc_ref_m,
            f"{late - early:.3f} mm, {(late - early) / 15.5:.1%} of TDC",
        ),
        "F6.12-same-stroke": Finding(
            acts["a"] == acts["c"] == 1 and acts["b"] == acts["d"] == 2,
            "fuel changes at dead centre " + ", ".join(f"{n} ({m})" for m, n in acts.items()),
        ),
    }
    findings |= {f"F6.11-moment-{m}": _moment(m) for m in MOMENTS}
    curves = [_errors(m, c) for m, c in cells.items()]
    return Found(findings, (_error_chart("Cascade, −15 % at the moments a to d", curves),))


def _moment(name: str) -> Finding:
    """Whether the moment that is run lies in the half of the stroke that the figure shows."""
    stroke, fraction = MOMENTS[name]
    early = fraction < 0.5
    return Finding(
        early == (name in "ac") and stroke == "abcd".index(name) // 2,
        f"at {fraction:g} of stroke {stroke + 1}",
    )


def single_moments(_quick: bool) -> Found:
    """The single loop at the moments a to d (Fig. 6.13)."""
    cells = {moment: cell(SINGLE, DOWN, moment) for moment in MOMENTS}
    peaks = [c.response.peak_mm for c in cells.values()]
    times = [c.response.settling_ms for c in cells.values()]
    spread = (max(peaks) - min(peaks)) / max(peaks)
    findings = {
        "F6.13-peak-equal": Finding(
            spread < 0.05, ", ".join(f"{p:.3f}" for p in peaks) + f" mm, within {spread:.1%}"
        ),
        "F6.13-timing": Finding(
            all(first_action(c) >= 2 for c in cells.values()),
            "settles in " + ", ".join(f"{t:.0f}" for t in times) + " ms",
        ),
    }
    curves = [_errors(m, c) for m, c in cells.items()]
    return Found(findings, (_error_chart("Single loop, −15 % at the moments a to d", curves),))


def levels(_quick: bool) -> Found:
    """The levels of control at work: from rest to generating, a misfire, restart (Fig. 6.1)."""
    run = course_of("start-restart", loop__clock="lockstep")
    fired = [dc for dc in run.dead_centres if dc.fuel_kg > 0.0]
    missed = sum(1 for e in run.events if e.code == "misfire")
    end = fired[-20:]
    error = max(abs(1e3 * abs(dc.x_m) - 15.5) for dc in end)
    started = run.mode == "generating" and len(fired) > 100
    start = Finding(started and missed == 1, f"{missed} misfire, ends {run.mode}")
    works = Finding(error < 0.1, f"last 20 dead centres within {error:.3f} mm of the set point")
    timed = Finding(
        missed == 1, f"{len(fired)} charges burnt, none missed but the forced one: "
        "each was injected and lit in its window",
    )  # fmt: skip
    x = series("x", [1e-3 * n for n in range(0, len(run.x_m), 4)],
               [1e3 * v for v in run.x_m[::4]])  # fmt: skip
    return Found(
        {"F6.1-start": start, "F6.1-piston": works, "F6.1-timing": timed, "F6.1-actuator": timed,
         "F6.1-prototype": timed, "S6.2.3-injection": timed},
        (Chart("Start, misfire, restart", "time [s]", "x [mm]", (x,)),),
    )  # fmt: skip


def supervision(_quick: bool) -> Found:
    """Level two holds a power: fuel and load such that TDC stays (Fig. 6.1)."""
    k = constants_of(NU, "harmonic")
    reached, errors = [], []
    for watts in _TARGETS_W:
        run = course_of("steady", loop__clock="lockstep", run__duration_s=4.0,
                        controller__supervisory__target_power_w=watts)  # fmt: skip
        end = run.dead_centres[-21:]
        omega = math.pi * 1e9 * (len(end) - 1) / (end[-1].t_ns - end[0].t_ns)
        works = [0.5 * sine_force_n(k, energy_j(k, dc.fuel_kg)) * abs(dc.x_m) for dc in end]
        reached.append(omega * statistics.fmean(works))
        errors.append(max(abs(abs(dc.x_m) - NU.tdc_ref_m) for dc in end))
    off = max(abs(p / w - 1.0) for p, w in zip(reached, _TARGETS_W, strict=True))
    told = f"{', '.join(f'{p:.1f}' for p in reached)} W, TDC within {1e6 * max(errors):.0f} um"
    curve = series("reached", _TARGETS_W, reached, "both")
    return Found(
        {"F6.1-supervisor": Finding(off < 0.01 and max(errors) < 1e-4, told)},
        (Chart("Power that is held", "target power [W]", "electric power [W]", (curve,)),),
    )


ENTRIES = (
    Entry("F6.1", "Levels of control at work",
          ("F6.1-start", "F6.1-piston", "F6.1-timing", "F6.1-actuator", "F6.1-prototype",
           "S6.2.3-injection"), levels, "hil run start-restart", 3.0),
    Entry("F6.3", "Power that the supervisory level holds", ("F6.1-supervisor",), supervision,
          "hil run steady --set controller.supervisory.target_power_w=1300", 4.0),
    Entry("F6.7", "Cascade after a load decrease: TDC and fuel",
          ("F6.7-settling", "F6.7-current-cycle", "F6.8-fuel-*", "F6.8-first-action",
           "F6.8-variation-small", "S6.3-*", "S7.1-*"), decrease,
          "hil compare load-decrease --controllers cascade,single-loop", 8.0),
    Entry("F6.9", "Cascade after a load increase", ("F6.9-settling", "F6.9-recovery"), increase,
          "hil compare load-increase --controllers cascade,single-loop", 8.0),
    Entry("F6.10", "Errors of cascade, single loop and no control",
          ("F6.10-*", "F6.5-*", "T6.2-*"), both_laws,
          "hil compare load-decrease --controllers cascade,single-loop", 8.0),
    Entry("F6.12", "Cascade at the moments a to d", ("F6.11-*", "F6.12-*"), cascade_moments,
          "hil compare load-decrease --controllers cascade", 8.0),
    Entry("F6.13", "Single loop at the moments a to d", ("F6.13-*",), single_moments,
          "hil compare load-decrease --controllers single-loop", 8.0),
)  # fmt: skip
