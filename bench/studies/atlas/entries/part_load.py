"""Throttle, ignition and motor force: the parameter studies of both engines in full."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.engine import charts
from bench.studies.engine.operation import BAR
from bench.studies.engine.sweep import DEGREES, SweepPoint, sweep
from plant.engines.detailed.figures import Figures

Pick = Callable[[Figures], float]


def picked(points: Sequence[SweepPoint], pick: Pick) -> list[float]:
    """One figure over a study, where the engine runs."""
    return [pick(p.figures) for p in points if p.figures is not None]


def rising(values: Sequence[float]) -> bool:
    """Whether each is greater than the one before."""
    return all(a < b for a, b in pairwise(values))


def told(values: Sequence[float], form: str, unit: str) -> str:
    """Say a row of figures."""
    return ", ".join(form.format(v) for v in values) + f" {unit}"


def throttle(_quick: bool) -> Found:
    """Power over throttle of both engines (Figs 4.15, 4.16)."""
    two, four = sweep("throttle", "nu-two-stroke"), sweep("throttle", "nu-four-stroke")
    p2, p4 = (picked(x, lambda f: f.indicated_w) for x in (two, four))
    e2, e4 = (picked(x, lambda f: f.electric_w) for x in (two, four))
    loss = picked(four, lambda f: f.friction_w + f.motoring_w)
    share = [e / p for e, p in zip(e2, p2, strict=True)]
    lower = Finding(
        max(p4) < min(p2) and (p4[-1] - p4[0]) < (p2[-1] - p2[0]),
        f"{p4[0]:.0f} to {p4[-1]:.0f} W, two-stroke {p2[0]:.0f} to {p2[-1]:.0f} W",
    )
    findings = {
        "F4.15-two-stroke-indicated-100": Finding(1e-3 * p2[-1]),
        "F4.15-two-stroke-indicated-50": Finding(1e-3 * p2[0]),
        "F4.15-electric": Finding(
            min(share) > 0.9 and rising(e2), f"{min(share):.1%} to {max(share):.1%} of indicated"
        ),
        "F4.15-four-lower": lower,
        "F4.15-load-reduced": _runs_on(two),
        "T4.4-two-range": Finding(
            e2[-1] - e2[0] > e4[-1] - e4[0],
            f"{e2[0]:.0f} to {e2[-1]:.0f} W, four-stroke {e4[0]:.0f} to {e4[-1]:.0f} W",
        ),
        "F4.16-indicated-100": Finding(1e-3 * p4[-1]),
        "F4.16-indicated-50": Finding(1e-3 * p4[0]),
        "F4.16-linear": _linear([p.value for p in four if p.figures], p4),
        "F4.16-loss-constant": Finding(
            max(loss) - min(loss) < 0.1 * max(loss), told((loss[0], loss[-1]), "{:.0f}", "W")
        ),
        "F4.16-electric-falls": Finding(
            rising(e4) and e4[0] / p4[0] < 0.8 * e4[-1] / p4[-1],
            f"{e4[0]:.0f} of {p4[0]:.0f} W at half, "
            f"{e4[-1]:.0f} of {p4[-1]:.0f} W at full throttle",
        ),
    }
    return Found(findings, (*charts.charts(two, "throttle", "two-stroke"),
                            *charts.charts(four, "throttle", "four-stroke")))  # fmt: skip


def _runs_on(points: Sequence[SweepPoint]) -> Finding:
    """Whether the engine neither stops nor strikes a head at any throttle, on a lower load."""
    stopped = [p.reason for p in points if p.figures is None]
    ratios = picked(points, lambda f: f.compression_ratio)
    return Finding(
        not stopped,
        "; ".join(stopped) or f"compression ratio {min(ratios):.1f} to {max(ratios):.1f}",
    )


def _linear(x: Sequence[float], y: Sequence[float]) -> Finding:
    """Whether points lie on a line within 2 % of their range."""
    import numpy as np

    slope, at_zero = np.polyfit(x, y, 1)
    off = max(abs(b - slope * a - at_zero) for a, b in zip(x, y, strict=True)) / (max(y) - min(y))
    return Finding(bool(off < 0.05), f"within {off:.1%} of the range from a line")


def ignition(_quick: bool) -> Found:
    """Pressure and power over ignition timing (Figs 4.17, 4.18)."""
    two, four = ([p for p in sweep("ignition", name) if p.value in DEGREES]
                 for name in ("nu-two-stroke", "nu-four-stroke"))  # fmt: skip
    e2, p2 = (picked(two, lambda f, k=k: getattr(f, k)) for k in ("electric_w", "indicated_w"))  # type: ignore[misc]
    cr = [picked(x, lambda f: f.compression_ratio) for x in (two, four)]
    peak = [picked(x, lambda f: f.p_max_pa / BAR) for x in (two, four)]
    share = picked(four, lambda f: 100.0 * f.motoring_w / f.indicated_w)
    change = _spread(picked(four, lambda f: f.indicated_w))
    findings = {
        "F4.17-cr-falls": Finding(
            rising(cr[0][::-1]) and rising(cr[1][::-1]),
            told(cr[0], "{:.2f}", "two-stroke, ") + told(cr[1], "{:.2f}", "four-stroke"),
        ),
        "F4.17-peak-rises": Finding(
            rising(peak[0]) and rising(peak[1]),
            told(peak[0], "{:.1f}", "bar two-stroke, ") + told(peak[1], "{:.1f}", "four-stroke"),
        ),
        "F4.17-nonpower": _nonpower(four),
        "F4.18-power-grows": Finding(rising(e2) and rising(p2), told(e2, "{:.0f}", "W electric")),
        "F4.18-electric-gain": Finding(1e-3 * (e2[-1] - e2[0])),
        "F4.18-electric-gain-share": Finding(100.0 * (e2[-1] / e2[0] - 1.0)),
        "F4.18-four-stroke": Finding(change < 0.05, f"indicated power within {change:.1%}"),
        "F4.18-compensation": Finding(share[-1], told(share, "{:.1f}", "% over the timings")),
    }
    return Found(findings, (*charts.charts(two, "ignition", "two-stroke"),
                            *charts.charts(four, "ignition", "four-stroke")))  # fmt: skip


def _spread(values: Sequence[float]) -> float:
    return (max(values) - min(values)) / max(values)


def _nonpower(points: Sequence[SweepPoint]) -> Finding:
    """Pressure of the left cylinder in its exhaust and intake strokes, over the timings."""
    import numpy as np

    tops = []
    for point in points:
        assert point.trace is not None
        third = len(point.trace.p_pa) // 3
        tops.append(float(np.max(point.trace.p_pa[third : 2 * third])) / BAR)
    return Finding(_spread(tops) < 0.1, told(tops, "{:.2f}", "bar at most between power strokes"))


def motor_force(_quick: bool) -> Found:
    """The four-stroke engine over its motor forces (Figs 4.19, 4.20)."""
    points = sweep("motor-force", "nu-four-stroke")
    speed, cr, power, motoring = (
        picked(points, pick)
        for pick in (lambda f: f.speed_rpm, lambda f: f.compression_ratio,
                     lambda f: f.indicated_w, lambda f: f.motoring_w)
    )  # fmt: skip
    share = [100.0 * m / p for m, p in zip(motoring, power, strict=True)]
    gaps = [_difference_ms(p) for p in points if p.trace is not None]
    findings = {
        "F4.19-sweep": Finding(
            not any(p.reason for p in points), "motors 1 to 3 in proportion, no contact, no stop"
        ),
        "F4.19-duration": Finding(rising(gaps[::-1]), told(gaps, "{:.1f}", "ms")),
        "F4.19-speed": Finding(rising(speed), told(speed, "{:.0f}", "rpm")),
        "F4.19-cr": Finding(rising(cr), told(cr, "{:.1f}", "")),
        "F4.19-power-stroke-same": _same_power_stroke(points),
        "F4.20-indicated": Finding(rising(power), told(power, "{:.0f}", "W")),
        "F4.20-compensation-grows": Finding(rising(motoring), told(motoring, "{:.0f}", "W")),
        "F4.20-compensation": Finding(
            math.fsum(share) / len(share), told(share, "{:.1f}", "% over the forces")
        ),
    }
    return Found(findings, charts.charts(points, "motor-force", "nu-four-stroke"))


def _turns_s(point: SweepPoint) -> list[float]:
    """Instants of the dead centres inside the trace."""
    t = point.trace
    assert t is not None
    return [float(t.t_s[n + 1]) for n in range(1, len(t.v_m_s) - 1)
            if t.v_m_s[n] * t.v_m_s[n + 1] < 0.0]  # fmt: skip


def _difference_ms(point: SweepPoint) -> float:
    """By how much the gas exchange strokes last longer than the power strokes."""
    t = point.trace
    assert t is not None
    turns = _turns_s(point)
    half = turns[1] if len(turns) > 1 else math.nan
    return 1e3 * ((float(t.t_s[-1]) - half) - half)


def _same_power_stroke(points: Sequence[SweepPoint]) -> Finding:
    """Speed over position of the first power stroke with the least and the greatest force."""
    from bench.studies.atlas.entries.measures import shape_agreement

    traces = [p.trace for p in points if p.trace is not None]
    alike = shape_agreement(traces[0], traces[-1])
    return Finding(alike > 0.99, f"correlation of the profiles {alike:.4f}")


ENTRIES = (
    Entry("F4.15", "Power over throttle, both cycles", ("F4.15-*", "F4.16-*", "T4.4-two-range"),
          throttle, "hil engine sweep --over throttle --engine nu-two-stroke", 8.0),
    Entry("F4.17", "Ignition timing: pressure over volume and power, both cycles",
          ("F4.17-cr-falls", "F4.17-peak-rises", "F4.17-nonpower", "F4.18-*"), ignition,
          "hil engine sweep --over ignition --engine nu-two-stroke", 4.0),
    Entry("F4.19", "Motor force: motion and shares of power, four-stroke", ("F4.19-*", "F4.20-*"),
          motor_force, "hil engine sweep --over motor-force --engine nu-four-stroke", 3.0),
)  # fmt: skip
