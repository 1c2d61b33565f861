"""The linear engine analysed: matrices, poles, damping, responses (thesis eqs. 5.61 to 5.84)."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.web.chart import Chart, Level, Series, series
from bench.web.chart_plot import plot_of
from bench.web.page import Page
from hil.config.prototypes import PROTOTYPES, Prototype
from hil.errors import ConfigError
from hil.nearest import listed
from plant.engines.fast.constants import constants_of
from plant.engines.fast.state_space import (
    LinearModel,
    critical_load_n_s_m,
    damping_ratio,
    frequency_response,
    linear_model,
    natural_frequency_rad_s,
    poles,
    root_locus,
    stable,
    state_space,
    step_response,
)

_OMEGA = np.geomspace(1.0, 2000.0, 400)
_MOST_LOADS = 2.0


class Case(NamedTuple):
    """One linear model of an engine, and what it is called."""

    name: str
    model: LinearModel


def cases(engine: str, fuel_kg: float | None, load_n_s_m: float | None) -> tuple[Case, Case]:
    """The engine that fires and the one after a misfire, whose stiffness is k0 (5.80).

    Parameters: fuel_kg, load_n_s_m : of the operating point; None for the engine's own
    Raises: ConfigError for an engine that there is not, or that has one chamber
    """
    found = PROTOTYPES.get(engine)
    if found is None or found.chambers < 2:
        known = [name for name, e in PROTOTYPES.items() if e.chambers == 2]
        raise ConfigError(f"engine {engine!r}: accepted are {listed(engine, known)}")
    fuel = found.fixed_fuel_kg if fuel_kg is None else fuel_kg
    load = found.load_coefficient_n_s_m if load_n_s_m is None else load_n_s_m
    fired = f"fired, {1e6 * fuel:.4g} mg at {load:g} N/(m/s)"
    return (_case(fired, found, fuel, load), _case("after a misfire", found, 0.0, load))


def _case(name: str, engine: Prototype, fuel_kg: float, load_n_s_m: float) -> Case:
    return Case(name, linear_model(constants_of(engine, "harmonic"), fuel_kg, load_n_s_m))


def told(case: Case) -> list[tuple[str, str]]:
    """What there is to say of a model, as names and values."""
    m, c, k = case.model
    space, omega = state_space(case.model), natural_frequency_rad_s(case.model)
    zeta, critical = damping_ratio(case.model), critical_load_n_s_m(case.model)
    damped = omega * math.sqrt(max(1.0 - zeta * zeta, 0.0))
    return [
        ("m, c, k", f"{m:g} kg, {c:g} N/(m/s), {k:.0f} N/m"),
        ("A", f"{_rows(space.a)}  [1/s², 1/s]"),
        ("B", _rows(space.b)),
        ("C", _rows(space.c)),
        ("poles", ", ".join(f"{p.real:.2f} {p.imag:+.2f} i" for p in poles(case.model)) + " 1/s"),
        ("natural frequency", f"{omega / (2.0 * math.pi):.3f} Hz, damped {_hz(damped)}"),
        ("damping ratio", f"{zeta:.4f}"),
        ("stable", "yes" if stable(case.model) else "no"),
        ("stability limit", "load 0: stable for every load above it"),
        ("overdamped above", f"{critical:.0f} N/(m/s), which eq. 5.76 prints as the limit"),
    ]


def _hz(omega: float) -> str:
    return f"{omega / (2.0 * math.pi):.3f} Hz"


def _rows(matrix: np.ndarray) -> str:
    return "[" + ", ".join("[" + ", ".join(f"{v:.6g}" for v in row) + "]" for row in matrix) + "]"


def charts(found: Sequence[Case]) -> tuple[Chart, ...]:
    """Bode diagram, step response, poles over the load."""
    hz = _OMEGA / (2.0 * math.pi)
    responses = [frequency_response(case.model, _OMEGA) for case in found]
    gain = [series(case.name, hz, 20.0 * np.log10(np.abs(g)))
            for case, g in zip(found, responses, strict=True)]  # fmt: skip
    phase = [series(case.name, hz, np.degrees(np.angle(g)))
             for case, g in zip(found, responses, strict=True)]  # fmt: skip
    t = np.linspace(0.0, 0.25, 501)
    step = [series(case.name, 1e3 * t, 1e6 * step_response(case.model, t)) for case in found]
    return (
        Chart("Bode diagram: gain", "frequency [Hz]", "x / F [dB, m/N]", tuple(gain), (), True),
        Chart("Bode diagram: phase", "frequency [Hz]", "phase [°]", tuple(phase),
              (Level("resonance", -90.0),), True),
        Chart("Step of 1 N", "time [ms]", "x [um]", tuple(step)),
        Chart("Root locus over the load", "real part [1/s]", "imaginary part [1/s]",
              tuple(curve for case in found for curve in _locus(case))),
    )  # fmt: skip


def _locus(case: Case) -> list[Series]:
    """Both branches from no load on, and where the poles are."""
    loads = np.linspace(0.0, _MOST_LOADS * critical_load_n_s_m(case.model), 801)
    upper, lower = root_locus(case.model, loads)
    near = np.abs(upper) + np.abs(lower) < 6.0 * natural_frequency_rad_s(case.model)
    path = np.concatenate([upper[near], lower[near][::-1]])
    here = poles(case.model)
    return [series(case.name, path.real, path.imag),
            series(f"{case.name}: here", here.real, here.imag, "points")]  # fmt: skip


def page(engine: str, found: Sequence[Case]) -> str:
    """The analysis as a page: figures beside each other, then the drawings."""
    title = f"Linear analysis: {engine}"
    sheet = Page(title)
    rows = zip(*(told(case) for case in found), strict=True)
    lines = "".join(
        f"<tr><th>{html.escape(row[0][0])}</th>"
        + "".join(f'<td class="number">{html.escape(text)}</td>' for _, text in row)
        + "</tr>"
        for row in rows
    )
    head = "".join(f"<th>{html.escape(case.name)}</th>" for case in found)
    plots = [plot_of(chart) for chart in charts(found)]
    return sheet.html(
        f"<header><div><h1>{html.escape(title)}</h1>"
        "<p>m x'' + c x' + k x = F, position and velocity as states (thesis eqs. 5.61 to 5.84)</p>"
        f'</div></header><div class="scroll"><table><thead><tr><th></th>{head}</tr></thead>'
        f"<tbody>{lines}</tbody></table></div><p></p>{sheet.row(plots[:2])}{sheet.row(plots[2:])}"
    )
