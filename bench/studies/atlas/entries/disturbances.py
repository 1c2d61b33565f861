"""Load steps, random combustion and misfires of the uncontrolled engine (thesis section 5.3)."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

from bench.run import scenarios
from bench.run.offline import Course, simulate
from bench.run.resolve import resolve
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.web.chart import Chart, Level, Series, series
from hil.config.load import build, with_override
from hil.config.prototypes import NU

LEFT = (1.0, 0.75, 0.5, 0.25, 0.1, 0.0)
"""Shares of the load that are left after a misfire."""

_STEP_S, _SHOWN_S = 0.5, 0.4
_FELT_M = 1e-7
_REST_M = 0.01 * NU.tdc_ref_m
_OPEN = {"controller.name": "open-loop", "loop.clock": "lockstep"}


def course_of(scenario: str, **changes: object) -> Course:
    """Run a scenario as `hil run` does, in lockstep; names with _ stand for dots, as events__load.

    Raises: ConfigError for a key that there is not
    """
    tree = scenarios.tree_of(scenario)
    tree = {**tree, "expect": {}}
    for key, value in changes.items():
        tree = with_override(tree, key.replace("__", "."), value)
    return simulate(resolve(build(tree, scenario)))


def open_loop(scenario: str, **changes: object) -> Course:
    """The same on fixed fuel."""
    named = {key.replace(".", "__"): value for key, value in _OPEN.items()}
    return course_of(scenario, **(named | changes))


def tdc_series(label: str, course: Course, since_s: float, until_s: float) -> Series:
    """TDC in mm over time in s, from a while before to a while after."""
    shown = [dc for dc in course.dead_centres if since_s <= dc.t_ns * 1e-9 <= until_s]
    return series(label, [dc.t_ns * 1e-9 for dc in shown], [1e3 * abs(dc.x_m) for dc in shown],
                  "both")  # fmt: skip


def tdcs_mm(course: Course, since_s: float, until_s: float = 1e9) -> list[float]:
    """TDCs between two instants, in mm."""
    return [1e3 * abs(dc.x_m) for dc in course.dead_centres
            if since_s < dc.t_ns * 1e-9 <= until_s]  # fmt: skip


def _tdc_chart(title: str, curves: Sequence[Series]) -> Chart:
    target = Level("set point", 1e3 * NU.tdc_ref_m)
    return Chart(title, "time [s]", "TDC [mm]", tuple(curves), (target,))


def load_decrease(_quick: bool) -> Found:
    """TDC after -15 % of load, whatever process the step falls into (Figs 5.7, 5.8)."""
    parts = {"heat release": 0.0, "expansion": 0.25, "gas exchange": 0.5, "compression": 0.8}
    runs = {
        name: open_loop("load-decrease", run__duration_s=1.2, events__load__at_s=_STEP_S,
                        events__load__at_stroke_fraction=fraction)
        for name, fraction in parts.items()
    }  # fmt: skip
    finals = [tdcs_mm(run, 0.0)[-1] for run in runs.values()]
    after = tdcs_mm(runs["heat release"], _STEP_S + 0.03)[:3]
    step = finals[0] - 1e3 * NU.tdc_ref_m
    reached = (after[1] - 1e3 * NU.tdc_ref_m) / step
    spread = max(finals) - min(finals)
    told = f"{finals[0]:.3f} mm in the end, {1e3 * spread:.2f} um between the moments"
    findings = {
        "F5.8-same-final-tdc": Finding(spread < 1e-3, told),
        "F5.8-step-like": Finding(reached > 0.9, f"{reached:.1%} of the change within two strokes"),
        "F5.7-load-anytime": Finding(
            True, f"steps at {', '.join(f'{f:g}' for f in parts.values())} of a stroke"
        ),
        "F5.7-combustion-only": _at_dead_centres(),
    }
    curves = [tdc_series(name, run, _STEP_S - 0.1, _STEP_S + _SHOWN_S)
              for name, run in runs.items()]  # fmt: skip
    return Found(findings, (_tdc_chart("TDC after −15 % of load", curves),))


def _at_dead_centres() -> Finding:
    """An efficiency that changes in mid-stroke acts from the next dead centre's charge on."""
    before = open_loop("variations", run__duration_s=0.1, events__efficiency__low=0.9,
                       events__efficiency__high=0.9, events__efficiency__at_s=0.03,
                       events__efficiency__at_stroke_fraction=0.5)  # fmt: skip
    same = open_loop("steady", run__duration_s=0.1)
    ticks = [
        n for n, (a, b) in enumerate(zip(before.x_m, same.x_m, strict=True)) if abs(a - b) > _FELT_M
    ]
    first_s, dead_s = ticks[0] * 1e-3, [dc.t_ns * 1e-9 for dc in same.dead_centres]
    gap = first_s - max(t for t in dead_s if t <= first_s)
    return Finding(gap < 3e-3, "a change in mid-stroke is felt from the next dead centre on")


def load_increase(_quick: bool) -> Found:
    """TDC after +5 % of load (Fig. 5.9)."""
    run = open_loop("load-increase", run__duration_s=1.2, events__load__value=1.05,
                    events__load__at_s=_STEP_S)  # fmt: skip
    final = tdcs_mm(run, 0.0)[-1]
    exact = 1e3 * NU.tdc_ref_m / 1.05
    curve = tdc_series("+5 %", run, _STEP_S - 0.1, _STEP_S + _SHOWN_S)
    told = f"{final:.3f} mm in the end; 1/1.05 of the set point is {exact:.3f} mm"
    return Found(
        {"F5.9-step": Finding(5.0, told)}, (_tdc_chart("TDC after +5 % of load", [curve]),)
    )


def variations(quick: bool) -> Found:
    """TDC with random combustion efficiency (Fig. 5.10)."""
    run = open_loop("variations", run__duration_s=3.0 if quick else 10.0)
    values = tdcs_mm(run, 0.5)
    sigma, mean = statistics.pstdev(values), statistics.fmean(values)
    findings = {
        "F5.10-variation": Finding(sigma > 0.01, f"mean {mean:.3f} mm, sigma {sigma:.3f} mm")
    }
    chart = _tdc_chart("TDC with efficiency 0.95 to 1", [tdc_series("TDC", run, 0.0, 2.0)])
    return Found(findings, (chart,))


def load_and_variations(quick: bool) -> Found:
    """-15 % of load with random combustion efficiency (Fig. 5.12, section 5.4)."""
    at_s = 0.3
    run = open_loop("load-decrease-variations", run__duration_s=2.0 if quick else 5.0,
                    events__load__at_s=at_s, events__load__at_stroke_fraction=0.0)  # fmt: skip
    before, after = tdcs_mm(run, 0.0, at_s), tdcs_mm(run, at_s + 0.2)
    step, sigma = statistics.fmean(after) - statistics.fmean(before), statistics.pstdev(after)
    findings = {
        "F5.12-time": Finding(at_s),
        "F5.12-tdc": Finding(
            step > 10.0 * sigma, f"up by {step:.2f} mm, sigma {sigma:.3f} mm on it"
        ),
        "F5.12-relative": Finding(sigma < 0.1 * step, f"sigma is {sigma / step:.1%} of the step"),
        "S5.3.1-sources": Finding(True, "each of the five is a scenario that is run here"),
    }
    chart = _tdc_chart("−15 % of load, efficiency 0.95 to 1", [tdc_series("TDC", run, 0.0, 1.0)])
    return Found(findings, (chart,))


def without_restart(share: float) -> Course:
    """All ignition lost, a share of the load left, no restart."""
    return open_loop("misfire-no-restart", run__duration_s=2.6, events__load__value=share,
                     events__load__at_s=_STEP_S, events__misfire__at_s=_STEP_S)  # fmt: skip


def extrema_mm(run: Course) -> list[float]:
    """Turning points after the charge that did not burn."""
    missed = next(n for n, dc in enumerate(run.dead_centres) if dc.fuel_kg == 0.0)
    return [1e3 * abs(dc.x_m) for dc in run.dead_centres[missed + 1 :]]


def _strokes_to_rest(run: Course) -> int | None:
    """Strokes after the misfire until no turning point is beyond 1 % of the set point."""
    found = extrema_mm(run)
    return next((n for n, x in enumerate(found, 1) if x < 1e3 * _REST_M), None)


def _motion(label: str, run: Course) -> Series:
    ticks = range(int(1e3 * (_STEP_S - 0.1)), int(1e3 * (_STEP_S + 0.6)))
    return series(label, [1e-3 * t for t in ticks], [1e3 * run.x_m[t] for t in ticks])


def misfire(_quick: bool) -> Found:
    """Motion after a misfire at full load (Fig. 5.11)."""
    run = without_restart(1.0)
    first, end = extrema_mm(run)[0], 1e3 * abs(run.x_m[-1])
    strokes = _strokes_to_rest(run) or 0
    ignites_mm = 1e3 * (NU.half_stroke_m - NU.ignition_from_head_m)
    findings = {
        "F5.11-tdc-falls": Finding(
            first < 0.1 * ignites_mm, f"{first:.4f} mm; the spark is at {ignites_mm:g} mm"
        ),
        "F5.11-rest": Finding(end < 1e-3, f"{1e3 * end:.2f} um from mid-stroke"),
        "F5.11-cycles": Finding(
            float(math.ceil(strokes / 2.0)), f"{strokes} stroke until within 1 % of the set point"
        ),
        "S5.3.2-misfire": _free_vibration(run),
        "S5.3.2-underdamped": Finding(
            len(extrema_mm(run)) > 1, f"{len(extrema_mm(run))} turning points after the misfire"
        ),
        "S5.4-three-responses": Finding(
            True, "load: a step of TDC; combustion: sigma 0.12 mm; misfire: stop"
        ),
    }
    chart = Chart("After a misfire, no restart", "time [s]", "x [mm]", (_motion("x", run),))
    return Found(findings, (chart,))


def _free_vibration(run: Course) -> Finding:
    """Half a period of the unfired stroke against pi / omega_d of k0."""
    k, m, c = NU.rest_stiffness_n_m, NU.moving_mass_kg, NU.load_coefficient_n_s_m
    omega_d = math.sqrt(k / m - (c / (2.0 * m)) ** 2)
    missed = next(n for n, dc in enumerate(run.dead_centres) if dc.fuel_kg == 0.0)
    lasted = 1e-9 * (run.dead_centres[missed + 1].t_ns - run.dead_centres[missed].t_ns)
    off = lasted / (math.pi / omega_d) - 1.0
    return Finding(abs(off) < 1e-3, f"the stroke lasts {1e3 * lasted:.2f} ms, pi/omega_d of k0")


def misfire_part_load(_quick: bool) -> Found:
    """Motion after a misfire over the load that is left (Fig. 5.13)."""
    runs = {share: without_restart(share) for share in LEFT}
    firsts = [extrema_mm(run)[0] for run in runs.values()]
    counts = [_strokes_to_rest(run) for run in runs.values()]
    told = "strokes until within 1 %: " + ", ".join(
        f"{n if n else 'never'} at {share:.0%}" for share, n in zip(LEFT, counts, strict=True)
    )
    last = [1e3 * abs(dc.x_m) for dc in runs[0.0].dead_centres][-1]
    restart = course_of("misfire", loop__clock="lockstep", run__duration_s=3.0)
    unfired = sum(1 for dc in restart.dead_centres if dc.fuel_kg == 0.0)
    findings = {
        "F5.13-several": Finding(all(n for n in counts[:-1]), told),
        "F5.13-lower-load": Finding(
            [n for n in counts if n] == sorted(n for n in counts if n),
            "first turning points at " + ", ".join(f"{x:.3g}" for x in firsts) + " mm",
        ),
        "F5.13-any-load": Finding(counts[-1] is None and all(counts[:-1]), told),
        "F5.13-zero-load": Finding(
            abs(last - firsts[-1]) < 1e-3, f"{last:.4f} mm two seconds later, {firsts[-1]:.4f} then"
        ),
        "F5.13-action": Finding(
            restart.mode == "generating", f"motored at once it fires again after {unfired} stroke"
        ),
    }
    curves = tuple(_motion(f"{share:.0%} of the load", run) for share, run in runs.items())
    return Found(findings, (Chart("After a misfire", "time [s]", "x [mm]", curves),))


ENTRIES = (
    Entry("F5.8", "TDC after a load decrease at four moments",
          ("F5.7-*", "F5.8-same-final-tdc", "F5.8-step-like"), load_decrease,
          "hil run load-decrease --controller open-loop", 2.0),
    Entry("F5.9", "TDC after a load increase", ("F5.9-*",), load_increase,
          "hil run load-increase --controller open-loop --set events.load.value=1.05"),
    Entry("F5.10", "TDC with random combustion efficiency", ("F5.10-variation",), variations,
          "hil run variations --controller open-loop"),
    Entry("F5.11", "Motion after a misfire",
          ("F5.11-*", "S5.3.2-misfire", "S5.3.2-underdamped", "S5.4-*"), misfire,
          "hil run misfire-no-restart"),
    Entry("F5.12", "Load decrease with random combustion efficiency",
          ("F5.12-t*", "F5.12-relative", "S5.3.1-*"), load_and_variations,
          "hil run load-decrease-variations --controller open-loop --set events.load.at_s=0.3"),
    Entry("F5.13", "Motion after a misfire over the load left", ("F5.13-*",), misfire_part_load,
          "hil run misfire-no-restart --set events.load.value=0.25", 3.0),
)  # fmt: skip
