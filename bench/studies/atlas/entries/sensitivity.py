"""What TDC and speed depend on (thesis section 6.2.1)."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from bench.run import scenarios
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.engine.charts import fuel_charts
from bench.studies.engine.sweep import FUEL_CHANGES, fuel_study
from bench.web.chart import Chart, series
from controller.build import make_params
from hil.config.prototypes import NU, Prototype
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import limit_cycle

_VARIED: dict[str, Callable[[Prototype, float], Prototype]] = {
    "moving mass m": lambda e, s: e.model_copy(update={"moving_mass_kg": s * e.moving_mass_kg}),
    "area A": lambda e, s: e.model_copy(update={"bore_m": math.sqrt(s) * e.bore_m}),
    "half stroke Ls": lambda e, s: e.model_copy(update={"half_stroke_m": s * e.half_stroke_m}),
    "compression ratio": lambda e, s: e.model_copy(
        update={"compression_ratio": s * e.compression_ratio}
    ),
}


def sensitivity(what: str) -> tuple[float, float]:
    """Relative change of TDC and of speed by that of one parameter, at the nominal point."""
    h = 1e-5
    found = []
    for s in (1.0 - h, 1.0 + h):
        engine = _VARIED[what](NU, s) if what in _VARIED else NU
        fuel = NU.fixed_fuel_kg * (s if what == "fuel" else 1.0)
        load = NU.load_coefficient_n_s_m * (s if what == "load k_v" else 1.0)
        cycle = limit_cycle(constants_of(engine, "harmonic"), fuel, load)
        found.append((math.log(cycle.tdc_m), math.log(cycle.frequency_hz)))
    return tuple((b - a) / (2.0 * h) for a, b in zip(*found, strict=True))


def sensitivities(_quick: bool) -> Found:
    """What TDC and speed depend on (Table 6.1; eq. 60 of Appendix II)."""
    names = ("moving mass m", "area A", "half stroke Ls", "fuel", "load k_v")
    s = {name: sensitivity(name) for name in (*names, "compression ratio")}
    tdc, speed = ({n: s[n][i] for n in names} for i in (0, 1))
    told = [", ".join(f"{n} {v:+.3f}" for n, v in part.items()) for part in (tdc, speed)]
    findings = {
        "T6.1-tdc": Finding(all(abs(v) > 0.01 for v in tdc.values()), told[0]),
        "T6.1-speed": Finding(
            abs(speed["load k_v"]) < 1e-9 and all(abs(speed[n]) > 0.01 for n in names[:-1]), told[1]
        ),
        "A2-F7-dependence": Finding(
            abs(s["compression ratio"][0]) > 0.01 and abs(tdc["fuel"]) > 0.01,
            f"compression ratio {s['compression ratio'][0]:+.3f}; throttle and air-fuel ratio by "
            f"the fuel, {tdc['fuel']:+.3f}",
        ),
    }
    order = range(1, len(names) + 1)
    curves = (
        series("TDC", order, tdc.values(), "both"),
        series("speed", order, speed.values(), "both"),
    )
    axis = "1 m, 2 A, 3 Ls, 4 fuel, 5 load"
    chart = Chart("Relative sensitivity at the nominal point", axis, "change per change", curves)
    return Found(findings, (chart,))


def fuel(_quick: bool) -> Found:
    """TDC and speed over fuel (Fig. 6.2), heads disregarded."""
    rows = fuel_study(tuple(n / 10.0 for n in range(-9, 10)))
    low, high = rows[0], rows[-1]
    gap, stroke = NU.half_stroke_m - NU.tdc_ref_m, 2.0 * NU.half_stroke_m
    around = 0.01 * stroke
    ratio = 0.5 * (stroke / (gap - around) - stroke / (gap + around))
    spans = [(high[n] - low[n]) / (high[n] + low[n]) for n in (1, 2)]
    findings = {
        "F6.2-fuel-low": Finding(100.0 * FUEL_CHANGES[0]),
        "F6.2-fuel-high": Finding(100.0 * FUEL_CHANGES[-1]),
        "F6.2-tdc-low": Finding(1e3 * low[1]),
        "F6.2-tdc-high": Finding(1e3 * high[1]),
        "F6.2-speed-low": Finding(low[2]),
        "F6.2-speed-high": Finding(high[2]),
        "F6.2-tdc-sensitive": Finding(
            spans[0] > spans[1], f"±{spans[0]:.0%} of TDC, ±{spans[1]:.0%} of speed"
        ),
        "S6.2.1-variation": Finding(100.0 * around / stroke),
        "S6.2.1-variation-mm": Finding(1e3 * around),
        "S6.2.1-variation-cr": Finding(ratio, "half of the range, at a gap of 4.5 mm on 40 mm"),
    }
    return Found(findings, fuel_charts(rows))


def estimator(_quick: bool) -> Found:
    """TDC as the controller's map of a stroke tells it beforehand (App. II Fig. 7)."""
    at_s, share = 0.5, 0.85
    changes = [("controller.name", "open-loop"), ("loop.clock", "lockstep"),
               ("run.duration_s", 1.2), ("events.load.at_s", at_s),
               ("events.load.at_stroke_fraction", 0.0)]  # fmt: skip
    scenario = resolve(scenarios.read("load-decrease", changes))
    engine = scenario.plant.believed()
    law = make_params(scenario.controller, engine, scenario.loop.period_ns)
    assert law.stroke_map is not None
    loads = {False: NU.load_coefficient_n_s_m, True: share * NU.load_coefficient_n_s_m}
    shown = []
    for a, b in pairwise(simulate(scenario).dead_centres[10:]):
        t_s, load = 1e-9 * b.t_ns, loads[1e-9 * b.t_ns > at_s + 0.04]
        predicted_m = law.stroke_map.end_of(a.fuel_kg, load, abs(a.x_m))
        shown.append((t_s, 1e3 * abs(b.x_m), 1e3 * predicted_m))
    known = [row for row in shown if not at_s < row[0] < at_s + 0.06]
    worst = max(abs(reached - told) for _, reached, told in known)
    t = [row[0] for row in shown]
    curves = (series("reached", t, [row[1] for row in shown], "both"),
              series("told a stroke before", t, [row[2] for row in shown], "both"))  # fmt: skip
    told = f"within {1e3 * worst:.2f} um from fuel, load and the dead centre before"
    return Found({"A2-F7-estimator": Finding(worst < 0.01, told)},
                 (Chart("TDC over a load step", "time [s]", "TDC [mm]", curves),))  # fmt: skip


ENTRIES = (
    Entry("A2-F7", "Estimator of TDC", ("A2-F7-estimator",), estimator),
    Entry("T6.1", "What TDC and speed depend on", ("T6.1-*", "A2-F7-dependence"), sensitivities),
    Entry("F6.2", "TDC and speed over fuel",
          ("F6.2-fuel-*", "F6.2-tdc-*", "F6.2-speed-*", "S6.2.1-variation*"), fuel,
          "hil engine sweep --over fuel"),
)  # fmt: skip
