"""The fast-response model: excitation, settled motion, frequency (chapter 5)."""

from __future__ import annotations

import math

import numpy as np

from bench.studies.atlas.entries.disturbances import open_loop
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import printed
from bench.studies.engine import analysis
from bench.web.chart import Chart, Level, series
from hil.config.prototypes import BIT, NU, Prototype
from plant.engines.fast.combustion import Burn, energy_j, force_n, sine_force_n
from plant.engines.fast.constants import Constants, constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc, limit_cycle
from plant.engines.fast.paths import acceleration, path_of
from plant.engines.fast.state_space import damping_ratio, linear_model, natural_frequency_rad_s

_MM = np.linspace(-15.5, 15.5, 125)


def _gas_force_n(k: Constants, burn: Burn, x_m: float) -> float:
    """Force of the gas alone on the piston, of either model."""
    path = path_of(k, burn, 0.0, 0.0, x=x_m, v=0.0, tau=0.0)
    return k.mass_kg * acceleration(path, x_m, 0.0, 0.0)


def excitation(_quick: bool) -> Found:
    """The square excitation and its Fourier series (Fig. 5.4)."""
    e = energy_j(constants_of(NU, "rectangular"), NU.fixed_fuel_kg)
    k = constants_of(NU, "rectangular")
    f, f0 = force_n(k, e), sine_force_n(k, e)
    phase = np.linspace(0.0, 4.0 * math.pi, 721)
    square = np.where(np.sin(phase) >= 0.0, f, -f)
    terms = {n: np.sum([4.0 * f / math.pi * np.sin(m * phase) / m
                        for m in range(1, n + 1, 2)], axis=0) for n in (1, 3, 9)}  # fmt: skip
    by_quadrature = float(np.trapezoid(square * np.sin(phase), phase) / (2.0 * math.pi))
    right, left = (_gas_force_n(k, Burn(d, e), 0.0) for d in (1, -1))
    findings = {
        "E5.53-harmonic": Finding(f0 / f, f"by quadrature {by_quadrature / f:.5f}"),
        "E5.11-excitation": Finding(
            right == f and left == -f, f"{right:+.0f} N to the right, {left:+.0f} N to the left"
        ),
    }
    degrees = np.degrees(phase)
    curves = [series("square", degrees, square, "steps")]
    curves += [series(f"harmonics to {n}", degrees, y) for n, y in terms.items()]
    return Found(findings, (Chart("Excitation", "phase [°]", "force [N]", tuple(curves)),))


def ideal_cycle(_quick: bool) -> Found:
    """The ideal cycle: two adiabats and a heat release at constant volume (Fig. 5.3)."""
    k = constants_of(NU, "nonlinear")
    e = energy_j(k, fuel_for_tdc(k, NU.tdc_ref_m, NU.load_coefficient_n_s_m))
    x = np.linspace(-NU.tdc_ref_m, NU.tdc_ref_m, 200)
    gap, size, area = k.half_stroke_m + x, k.half_stroke_m, k.area_m2
    unburnt = k.p0_pa * (size / gap) ** k.gamma
    burnt = unburnt + e * size ** (k.gamma - 1.0) / area * gap**-k.gamma
    work = float(np.trapezoid(burnt - unburnt, area * gap))
    slope = (np.log(burnt[-1]) - np.log(burnt[0])) / (np.log(gap[-1]) - np.log(gap[0]))
    findings = {
        "F5.3-cycle": Finding(
            abs(slope + k.gamma) < 1e-9,
            f"both lines have the exponent {-slope:.4f}, the release is at the dead centre; "
            f"{work:.1f} J a stroke",
        ),
        "E5.13-pressure": Finding(
            bool(np.isclose(np.interp(0.0, x, unburnt), k.p0_pa, rtol=1e-4)),
            f"unfired {1e-5 * float(np.interp(0.0, x, unburnt)):.4f} bar at mid-stroke",
        ),
    }
    volume = 1e6 * area * gap
    curves = (
        series("compression", volume, 1e-5 * unburnt),
        series("expansion", volume, 1e-5 * burnt),
        series("heat release", volume[[0, 0]], 1e-5 * np.array([unburnt[0], burnt[0]])),
    )
    return Found(findings, (Chart("Ideal cycle", "volume [cm³]", "pressure [bar]", curves),))


def gas_force(_quick: bool) -> Found:
    """Linear and non-linear gas force over the stroke (eq. 5.37, section 5.2, App. II 2.4)."""
    linear, full = constants_of(NU, "rectangular"), constants_of(NU, "nonlinear")
    burn = Burn(1, energy_j(linear, NU.fixed_fuel_kg))
    at_x = [[_gas_force_n(k, burn, 1e-3 * x) for x in _MM] for k in (linear, full)]
    alike = float(np.corrcoef(at_x[0], at_x[1])[0, 1])
    start = at_x[1][0] / at_x[0][0]
    hz = [limit_cycle(k, fuel_for_tdc(k, NU.tdc_ref_m, NU.load_coefficient_n_s_m),
                      NU.load_coefficient_n_s_m).frequency_hz
          for k in (constants_of(NU, "harmonic"), full)]  # fmt: skip
    h = 1e-6
    rest = Burn(1, 0.0)
    slope = (_gas_force_n(full, rest, h) - _gas_force_n(full, rest, -h)) / (2.0 * h)
    findings = {
        "S5.2-limits": Finding(
            start > 1.5, f"at the dead centre the gas pushes {start:.2f} times as much"
        ),
        "A2-S2.4-linear": Finding(
            alike > 0.8 and abs(hz[1] / hz[0] - 1.0) < 0.1,
            f"correlation {alike:.3f}, {hz[0]:.2f} and {hz[1]:.2f} Hz at one TDC",
        ),
        "T5.1-analogy": Finding(
            abs(-slope / linear.rest_stiffness_n_m - 1.0) < 1e-6,
            f"slope of the gas force at mid-stroke {-slope:.0f} N/m, stiffness "
            f"{linear.rest_stiffness_n_m:.0f} N/m",
        ),
    }
    curves = (series("linear", _MM, at_x[0]), series("non-linear", _MM, at_x[1]))
    chart = Chart("Gas force after a combustion", "x [mm]", "force [N]", curves)
    return Found(findings, (chart,))


def settled_motion(_quick: bool) -> Found:
    """The settled motion of eq. 5.60, from runs (sections 5.1.1, 5.1.5)."""
    run = open_loop("steady", run__duration_s=1.0)
    dcs = run.dead_centres[-20:]
    hz = 0.5e9 * (len(dcs) - 1) / (dcs[-1].t_ns - dcs[0].t_ns)
    model = linear_model(constants_of(NU, "harmonic"), dcs[-1].fuel_kg, NU.load_coefficient_n_s_m)
    natural = natural_frequency_rad_s(model) / (2.0 * math.pi)
    cycle = limit_cycle(constants_of(NU, "harmonic"), dcs[-1].fuel_kg, NU.load_coefficient_n_s_m)
    t = 1e-9 * dcs[0].t_ns
    ticks = range(math.ceil(1e3 * t), len(run.x_m))
    sign = math.copysign(1.0, dcs[0].x_m)
    ideal = [sign * cycle.tdc_m * math.cos(2.0 * math.pi * natural * (1e-3 * n - t)) for n in ticks]
    off = max(abs(a - run.x_m[n]) for a, n in zip(ideal, ticks, strict=True))
    free = open_loop("misfire-no-restart", run__duration_s=1.5, events__load__value=0.0,
                     events__load__at_s=0.3, events__misfire__at_s=0.3)  # fmt: skip
    kept = abs(free.dead_centres[-1].x_m / free.dead_centres[-10].x_m) - 1.0
    stoichiometric = NU.p0_pa * NU.area_m2 * NU.half_stroke_m / (NU.gas_constant_j_kg_k * NU.t0_k)
    findings = {
        "E5.58-frequency": Finding(
            abs(hz / natural - 1.0) < 1e-5, f"{hz:.4f} Hz of the run, {natural:.4f} Hz"
        ),
        "E5.60-solution": Finding(off < 1e-6, f"the run is within {1e9 * off:.0f} nm of it"),
        "S5.1.1-friction": Finding(
            abs(kept) < 1e-9, "without load and charge the amplitude stays to 1e-9"
        ),
        "S5.1.1-load": Finding(*_load_force()),
        "E5.76-stability": _printed_condition(),
        "E5.27-afr": Finding(
            abs(stoichiometric / NU.air_fuel_ratio / NU.full_throttle_fuel_kg - 1.0) < 1e-12,
            f"air over fuel {NU.air_fuel_ratio:g} at wide open throttle",
        ),
    }
    x_ms = [n - 1e3 * t for n in ticks]
    curves = (series("run", x_ms, [1e3 * run.x_m[n] for n in ticks]),
              series("eq. 5.60", x_ms, [1e3 * x for x in ideal]))  # fmt: skip
    return Found(findings, (Chart("Settled motion", "time [ms]", "x [mm]", curves),))


def _load_force() -> tuple[bool, str]:
    """The force of the load is -c v: what it adds to the acceleration at a speed."""
    k, c, v = constants_of(NU, "rectangular"), NU.load_coefficient_n_s_m, 2.0
    burn = Burn(1, 0.0)
    paths = [path_of(k, burn, load, 0.0, x=0.0, v=v, tau=0.0) for load in (0.0, c)]
    forces = [k.mass_kg * acceleration(path, 0.0, v, 0.0) for path in paths]
    added = forces[1] - forces[0]
    return abs(added + c * v) < 1e-9, f"{added:.0f} N at {v:g} m/s and {c:g} N/(m/s)"


def _printed_condition() -> Finding:
    """c^2 > 4 m k of the engine that runs; it is stable without."""
    model = linear_model(constants_of(NU, "harmonic"), NU.fixed_fuel_kg, NU.load_coefficient_n_s_m)
    ratio = damping_ratio(model)
    return Finding(
        ratio > 1.0, f"the engine runs stable at a damping ratio of {ratio:.2f}, below critical"
    )


def analysed(_quick: bool) -> Found:
    """The linear engine fired and after a misfire (eqs. 5.61 to 5.84)."""
    return Found({}, analysis.charts(analysis.cases("nu", None, None)))


def beijing(_quick: bool) -> Found:
    """Displacement of the Beijing engine by the linear model (Fig. 5.5, App. II Fig. 6)."""
    k = constants_of(BIT, "harmonic")
    cycle = limit_cycle(k, BIT.full_throttle_fuel_kg, BIT.load_coefficient_n_s_m)
    hz = cycle.frequency_hz
    scale = printed("F5.5-frequency-test") / hz
    told = f"20 Hz over our {hz:.2f} Hz; 1.15 makes {1.15 * hz:.2f} Hz"
    faster = _nonlinear_hz(BIT, cycle.tdc_m)
    findings = {
        "F5.5-frequency-model": Finding(hz),
        "A2-S3-frequency-model": Finding(hz),
        "F5.5-time-scale": Finding(scale, told),
        "A2-S3-time-scale": Finding(scale, told),
        "A2-S3-throttle": Finding(
            BIT.full_throttle_fuel_kg > 0.0,
            f"{1e6 * BIT.full_throttle_fuel_kg:.3f} mg, what wide open throttle lets in at "
            f"{BIT.air_fuel_ratio:g}",
        ),
        "A2-S3-cause": Finding(
            faster > hz, f"the non-linear gas force alone makes {faster:.2f} Hz of {hz:.2f} Hz"
        ),
    }
    t = np.linspace(0.0, 0.15, 601)
    x = -1e3 * cycle.tdc_m * np.cos(2.0 * math.pi * hz * t)
    curves = (series("linear model", 1e3 * t, x), series("time scaled by 1.15", 1e3 * t / 1.15, x))
    chart = Chart("Beijing engine at wide open throttle", "time [ms]", "x [mm]", curves,
                  (Level("head", 1e3 * BIT.half_stroke_m),))  # fmt: skip
    return Found(findings, (chart,))


def _nonlinear_hz(engine: Prototype, tdc_m: float) -> float:
    """Frequency of the non-linear model at a TDC, or at the nearest one that it settles at."""
    k = constants_of(engine, "nonlinear")
    tdc = min(tdc_m, engine.tdc_ref_m)
    return limit_cycle(k, fuel_for_tdc(k, tdc, engine.load_coefficient_n_s_m),
                       engine.load_coefficient_n_s_m).frequency_hz  # fmt: skip


def cost(_quick: bool) -> Found:
    """What evaluating the linear model costs beside the engine in full (section 5.2)."""
    import time

    from bench.studies.engine.operation import operate
    from hil.config.detailed import read
    from plant.engines.detailed.engine import engine_of, run_for, running

    k = constants_of(NU, "harmonic")
    engine = engine_of(read("nu-two-stroke"))
    operate(engine.calibration)  # compiled by now
    begun = time.process_time()
    for _ in range(100):
        limit_cycle(k, NU.fixed_fuel_kg, NU.load_coefficient_n_s_m)
    fast_s = (time.process_time() - begun) / 100
    begun = time.process_time()
    run_for(engine, running(engine), 1.0)
    full_s = time.process_time() - begun
    return Found({"S5.2-speed": Finding(
        full_s > 10.0 * fast_s, "settled motion in closed form, beside a second of the other"
    )})  # fmt: skip


ENTRIES = (
    Entry("F5.3", "Ideal cycle", ("F5.3-*", "E5.13-*"), ideal_cycle),
    Entry("F5.4", "Square excitation and its Fourier series", ("E5.53-*", "E5.11-*"), excitation),
    Entry("E5.37", "Linear and non-linear gas force",
          ("S5.2-limits", "A2-S2.4-*", "T5.1-*"), gas_force),
    Entry("E5.60", "Settled motion",
          ("E5.58-*", "E5.60-*", "S5.1.1-*", "E5.76-*", "E5.27-*"), settled_motion,
          "hil run steady --controller open-loop"),
    Entry("E5.71", "Linear analysis: Bode diagram, step, poles over the load", (), analysed,
          "hil engine analyse"),
    Entry("F5.5", "Displacement of the Beijing engine",
          ("F5.5-frequency-model", "F5.5-time-scale", "A2-S3-frequency-model", "A2-S3-t*",
           "A2-S3-cause"), beijing),
    Entry("S5.2", "Cost of the linear model", ("S5.2-speed",), cost),
)  # fmt: skip
