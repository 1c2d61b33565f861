"""The equations of the engines in full, by evaluating them (chapter 3, Appendix I section 2)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.engine.operation import operate, varied
from bench.studies.engine.trace import Trace
from bench.web.chart import Chart, series
from hil.config.detailed import Calibration, read
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import (
    Engine,
    at_rest,
    begin,
    engine_of,
    run_for,
    running,
    strokes,
)
from plant.engines.detailed.gas import heat_release, heat_to_wall
from plant.engines.detailed.kernel import case_pressure, rates, ring_friction
from plant.engines.detailed.solver import advance, scratch
from plant.engines.detailed.types import Array

_TWO, _FOUR, _RUN, _START = "nu-two-stroke", "nu-four-stroke", "bit-running", "bit-starting"
_DOUBLE = 1.001
_ENDS = "at the dead centre that ends stroke {}"


def _exponent(f: Callable[[float], float], value: float) -> float:
    """The power of a quantity in a law, from two values close by."""
    return math.log(f(_DOUBLE * value) / f(value)) / math.log(_DOUBLE)


def heat(_quick: bool) -> Found:
    """Hohenberg's law as the engine evaluates it (eq. 3.18), and the heat release (eq. 3.19)."""
    engine = engine_of(read(_TWO))
    p, wall_k = engine.p, engine.calibration.left.wall_k

    def coefficient(volume: float = 1e-5, p_gas: float = 2e6, t_gas: float = 1500.0) -> float:
        return float(heat_to_wall(p, 0, 1.0, volume, 0.01, p_gas, t_gas)) / (t_gas - wall_k)

    speeds, factors = _heat_by_speed(_START)
    share = engine.calibration.heat.hohenberg
    exponent, offset = _speed_law(speeds, factors)
    findings = {
        "E3.18-factor": Finding(
            float(p[at.HOHENBERG]) / (share * 1e5**-0.8), f"times a calibrated share of {share:g}"
        ),
        "E3.18-volume-exponent": Finding(_exponent(lambda v: coefficient(volume=v), 1e-5)),
        "E3.18-pressure-exponent": Finding(_exponent(lambda x: coefficient(p_gas=x), 2e6)),
        "E3.18-temperature-exponent": Finding(_exponent(lambda t: coefficient(t_gas=t), 1500.0)),
        "E3.18-velocity-exponent": Finding(exponent, "by the speeds of the strokes in starting"),
        "E3.18-velocity-offset": Finding(offset, "by the speeds of the strokes in starting"),
    }
    t = np.linspace(0.0, 8e-3, 161)
    curve = series("Q'/Q", 1e3 * t, [1e-3 * float(heat_release(p, 1.0, x)) for x in t])
    chart = Chart(
        "Heat release", "time from the spark [ms]", "share of the charge [1/ms]", (curve,)
    )
    return Found(findings, (chart,))


def _heat_by_speed(name: str) -> tuple[Array, Array]:
    """Mean speed of each stroke, and the factor of heat transfer that the next one has."""
    engine = engine_of(read(name))
    motion = at_rest(engine)
    begin(engine, motion, 1)
    y, d, record = motion
    work, factors = scratch(), []
    for _ in range(12):
        advance(engine.p, d, y, engine.programme, work, record, d[at.T] + 0.5, True)
        factors.append(float(d[at.HEAT] / engine.p[at.HOHENBERG]))
    rows = strokes(motion)
    speed = np.abs(np.diff(rows[:, at.REC_X])) / np.diff(rows[:, at.REC_T])
    return speed, np.array(factors[1:])


def _speed_law(speed: Array, factor: Array) -> tuple[float, float]:
    """Exponent n and offset b of (v + b)^n, from first, middle and last stroke by bisection."""
    picked = (0, len(speed) // 2, len(speed) - 1)
    v, f = speed[list(picked)], np.log(factor[list(picked)])

    def mismatch(b: float) -> float:
        log = np.log(v + b)
        return float((f[1] - f[0]) / (log[1] - log[0]) - (f[2] - f[0]) / (log[2] - log[0]))

    low, high = 0.2, 5.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if mismatch(low) * mismatch(middle) > 0.0 else (low, middle)
    return float((f[2] - f[0]) / np.log((v[2] + low) / (v[0] + low))), low


def friction(_quick: bool) -> Found:
    """Friction of machine and rings (section 3.2.2)."""
    p = engine_of(read(_TWO)).p

    def ring(v: float, p_gas: float) -> float:
        return float(ring_friction(p, 0, v, p_gas))

    root = _exponent(lambda v: ring(v, 1e6), 2.0)
    lines = [ring(2.0, x) for x in (0.0, 1e6, 2e6)]
    even = lines[2] - 2.0 * lines[1] + lines[0]
    v = np.linspace(0.0, 4.0, 81)
    findings = {
        "S3.2.2-machine-friction": _machine_friction(),
        "S3.2.2-friction-law": Finding(
            abs(root - 0.5) < 1e-6 and abs(even) < 1e-9 and ring(-2.0, 1e6) == ring(2.0, 1e6),
            f"exponent of speed {root:.4f}; second difference over pressure {even:.1e} N",
        ),
    }
    curves = tuple(series(f"{bar} bar", v, [ring(x, 1e5 * bar) for x in v]) for bar in (1, 10, 40))
    return Found(findings, (Chart("Ring friction", "speed [m/s]", "force [N]", curves),))


def _machine_friction() -> Finding:
    """Friction with the rings taken away, at two speeds."""
    engine = engine_of(varied(read(_TWO), friction={"f": 0.0}))
    motion = running(engine)
    y, d, out, found = motion.y.copy(), motion.d.copy(), np.zeros(at.N_Y), []
    for v in (0.5, 3.0):
        y[at.V] = v
        rates(engine.p, d, y, out, 0.0)
        found.append(float(out[at.W_FRICTION]) / v)
    return Finding(abs(found[1] - found[0]) < 1e-9, f"{found[0]:.1f} and {found[1]:.1f} N")


def valves(_quick: bool) -> Found:
    """What happens at which position of which stroke (Table 3.1, sections 3.1.3 and 3.3.3)."""
    two, four = engine_of(read(_TWO)), engine_of(read(_FOUR))
    c2 = two.calibration.cycle
    rows = four.programme
    generates = [not np.any(p[:, 1] == at.MOTOR) and bool(np.any(p[:, 1] == at.GENERATE))
                 for p in rows]  # fmt: skip
    o2 = operate(read(_TWO))
    closes = (c2.exhaust_closes_m or 0.0, c2.intake_closes_m or 0.0)
    opens = (c2.exhaust_opens_m or 0.0, c2.intake_opens_m or 0.0)
    orders = [sorted({int(code) for code in p[:, 1] if code}) for p in rows]
    findings = {
        "T3.1-two-stroke-generator": Finding(
            o2.figures.motoring_w == 0.0
            and bool(np.all(np.abs(np.diff(o2.rows[:, at.REC_PHASE])) == 1.0)),
            "the machine never motors, and the strokes alternate",
        ),
        "T3.1-four-stroke-1": _does(orders[0], at.OPEN_INTAKE, at.MOTOR, "motor 1"),
        "T3.1-four-stroke-2": _does(orders[1], at.CLOSE_INTAKE, at.MOTOR, "motor 3"),
        "T3.1-four-stroke-3": Finding(generates[2], "the machine generates through stroke 3"),
        "T3.1-four-stroke-4": Finding(
            at.GENERATE in orders[3] and at.OPEN_EXHAUST in orders[3],
            "generates until motor 4 takes over, as Table 4.2 has it",
        ),
        "S3.1.3-ivc": Finding(at.CLOSE_INTAKE in orders[1], _ENDS.format(1)),
        "S3.3.3-ivo": Finding(at.OPEN_INTAKE in orders[0], _ENDS.format(4)),
        "S3.3.3-evo": Finding(at.OPEN_EXHAUST in orders[3], _ENDS.format(3)),
        "S3.3.3-ivc": Finding(False, _ENDS.format(1)),
        "S3.3.3-valve-order": Finding(
            opens[0] < opens[1] and closes[0] < closes[1],
            f"exhaust {1e3 * opens[0]:g} to {1e3 * closes[0]:g}, "
            f"intake {1e3 * opens[1]:g} to {1e3 * closes[1]:g} mm from the head",
        ),
        "S3.3.3-valve-step": _valve_states(two, four),
        "S3.3.3-compressor": Finding(
            two.calibration.breathing.intake_pa > two.calibration.breathing.exhaust_pa,
            f"{1e-5 * two.calibration.breathing.intake_pa:g} bar in the intake manifold",
        ),
    }  # fmt: skip
    return Found(findings, (_lift_chart(two.calibration),))


def _valve_states(*engines: Engine) -> Finding:
    """What states the valves of both cylinders are in over 0.2 s."""
    seen: set[float] = set()
    for engine in engines:
        motion = running(engine)
        while motion.d[at.T] < 0.2:
            run_for(engine, motion, 1e-3)
            for c in (at.CYL, at.CYL + at.CYL_STRIDE):
                seen |= {float(motion.d[c + at.INTAKE]), float(motion.d[c + at.EXHAUST])}
    return Finding(seen == {0.0, 1.0}, "open with the whole lift, or closed")


def _does(order: list[int], valve: int, mode: int, told: str) -> Finding:
    return Finding(valve in order and mode in order, f"valves as told, {told}")


def _lift_chart(c: Calibration) -> Chart:
    """Lift of both valves of the left cylinder over displacement (Fig. 3.8)."""
    x = np.linspace(-1e3 * c.left.length_m, 1e3 * c.left.length_m, 401)
    gap, lift = x + 1e3 * c.left.length_m, 1e3 * c.breathing.lift_m
    curves = []
    cycle = c.cycle
    for name, out, back in (
        ("exhaust", cycle.exhaust_opens_m, cycle.exhaust_closes_m),
        ("intake", cycle.intake_opens_m, cycle.intake_closes_m),
    ):
        for way, edge in (("expansion", out), ("compression", back)):
            y = np.where(gap > 1e3 * (edge or 0.0), lift, 0.0)
            curves.append(series(f"{name}, {way}", x, y))
    return Chart("Lift of the left cylinder's valves", "x [mm]", "lift [mm]", tuple(curves))


def exchange(_quick: bool) -> Found:
    """Pressure of an open cylinder, and of the scavenge case (sections 3.2.3, App. I 2.3)."""
    two, bit = operate(read(_TWO)), operate(read(_RUN))
    c = two.engine.calibration.cycle
    findings = {
        "S3.2.3-gas-exchange-pressure": _ambient(two.trace, c.exhaust_opens_m, two.engine.p),
        "A1-gas-exchange-pressure": _ambient(
            bit.trace, bit.engine.calibration.cycle.exhaust_opens_m, bit.engine.p
        ),
        "A1-scavenge": _adiabat(),
        "S3.3.2-step": Finding(two.engine.calibration.running.step_s, _FINE),
        "A1-step": Finding(bit.engine.calibration.running.step_s, _FINE),
    }
    return Found(findings)


_FINE = "with located events; a twentieth of it moves no dead centre by 2 um"


def _ambient(trace: Trace, opens_m: float | None, p: Array) -> Finding:
    """Pressure of the left cylinder well after its exhaust has opened."""
    gap = trace.x_m + p[at.CYL_P + at.LENGTH]
    open_ = gap > (opens_m or 0.0) + 4e-3
    bars = trace.p_pa[open_] * 1e-5
    return Finding(
        bool(np.max(bars) < 1.15 and np.min(bars) > 0.85),
        f"{np.min(bars):.2f} to {np.max(bars):.2f} bar from 4 mm after the exhaust opens",
    )


def _adiabat() -> Finding:
    """Follow p V^gamma under a piston while its ports are covered and its reed is closed."""
    engine = engine_of(read(_START))
    motion = running(engine)
    y, d = motion.y.copy(), motion.d.copy()
    d[at.CYL + at.INTAKE] = d[at.CYL + at.CYL_STRIDE + at.INTAKE] = 0.0
    p = engine.p.copy()
    for b in (at.CYL_P, at.CYL_P + at.CYL_P_STRIDE):
        p[b + at.CDA_LEAK] = 0.0
    y[at.CASE_U] *= 1.05  # above ambient: the reed is closed
    y[at.V], out = 1.0, np.zeros(at.N_Y)
    rates(p, d, y, out, 0.0)
    before, h = case_pressure(p, y, 0), 1e-7
    volume = p[at.CASE_VOLUME] - p[at.CASE_AREA] * y[at.X]
    y2 = y + h * out
    change = (case_pressure(p, y2, 0) / before - 1.0) / (h * p[at.CASE_AREA] / volume)
    return Finding(
        abs(change / p[at.GAMMA] - 1.0) < 1e-3, f"exponent {change:.4f}, gamma {p[at.GAMMA]:g}"
    )


ENTRIES = (
    Entry("T3.1", "Processes and machine by stroke; valve lift (Fig. 3.8)",
          ("T3.1-*", "S3.1.3-*", "S3.3.3-iv[oc]", "S3.3.3-evo", "S3.3.3-valve-*",
           "S3.3.3-compressor"), valves),
    Entry("S3.2.2", "Friction", ("S3.2.2-machine-friction", "S3.2.2-friction-law"), friction),
    Entry("S3.2.3", "Gas exchange and scavenge case",
          ("S3.2.3-*", "A1-gas-exchange-pressure", "A1-scavenge", "S3.3.2-step", "A1-step"),
          exchange),
    Entry("E3.18", "Heat to the wall and heat release", ("E3.18-*",), heat),
)  # fmt: skip
