"""The four models behind one interface: make a path for a stroke, move along it."""

from __future__ import annotations

import math

from plant.engines.fast import linear, nonlinear
from plant.engines.fast.combustion import Stroke, force_n, sine_force_n, stiffness_n_m
from plant.engines.fast.linear import NO_STOP, UNDAMPED_BELOW_N_S_M, Segment
from plant.engines.fast.nonlinear import GasPath
from plant.params import Engine

CLOSED_FORM = "closed-form"
HARMONIC = "harmonic"
RECTANGULAR = "rectangular"
NONLINEAR = "nonlinear"

Path = Segment | GasPath

# A path is searched in sixteenths of half a period, for at most this many of them.
_SEARCH_STEPS = 16 * 40


def latches(engine: Engine, energy_j: float, c: float, force: float) -> bool:
    """Tell whether the stroke now starting is one of eq. 5.60, settled by its dead centre."""
    generating = c > UNDAMPED_BELOW_N_S_M and force == 0.0
    return engine.model == CLOSED_FORM and energy_j > 0.0 and generating


def path_of(
    engine: Engine, stroke: Stroke, c: float, force: float, *, x: float, v: float, tau: float
) -> Path:
    """Make the path from (x, v) at tau on, with damping c and constant force.

    Parameters: tau : float, time since the stroke's start [s]
    """
    energy = stroke.energy_j
    if engine.model == NONLINEAR:
        return gas_path(engine, stroke, c, force)
    k = stiffness_n_m(engine, energy)
    if stroke.latched:
        omega = math.sqrt(k / engine.mass_kg)
        x_end = stroke.direction * sine_force_n(engine, energy) / (c * omega)
        return linear.half_cosine(omega, x, x_end)
    sine = 0.0
    if engine.model == RECTANGULAR:
        force += stroke.direction * force_n(engine, energy)
    else:
        sine = stroke.direction * sine_force_n(engine, energy)
    return linear.segment(engine.mass_kg, c, k, force_n=force, sine_n=sine, x=x, v=v, tau=tau)


def gas_path(engine: Engine, stroke: Stroke, c: float, force: float) -> GasPath:
    """A p0 Ls^gamma, plus E Ls^(gamma-1) on the side that fired     (thesis eqs. 5.21, 5.22)."""
    gamma, size, m = engine.gamma, engine.half_stroke_m, engine.mass_kg
    spring = engine.area_m2 * engine.p0_pa * size**gamma / m
    burnt = stroke.energy_j * size ** (gamma - 1.0) / m
    left = spring + (burnt if stroke.direction > 0 else 0.0)
    right = spring + (burnt if stroke.direction < 0 else 0.0)
    return GasPath(left, right, -gamma, c / m, force / m, size)


def advance(
    path: Path, x: float, v: float, tau: float, dt: float, *, direction: int, contact_m: float
) -> tuple[float, float, float, int]:
    """Move on by dt, or to the first dead centre or contact within it.

    Returns: (x, v, time used [s], NO_STOP | DEAD_CENTRE | CONTACT)
    """
    if isinstance(path, Segment):
        return linear.advance(path, tau, dt, direction, contact_m)
    return nonlinear.advance(path, x, v, dt, direction)


def acceleration(path: Path, x: float, v: float, tau: float) -> float:
    """Return x'' on the path."""
    if isinstance(path, Segment):
        return linear.acceleration(path, tau, x, v)
    return nonlinear.acceleration(path, x, v)


def net_force_n(engine: Engine, x: float, force: float) -> float:
    """Force on a piston at rest at x: the two air springs and the machine."""
    if engine.model != NONLINEAR:
        return force - engine.rest_stiffness_n_m * x
    size = engine.half_stroke_m
    spring = engine.area_m2 * engine.p0_pa * size**engine.gamma
    left, right = (size + x) ** -engine.gamma, (size - x) ** -engine.gamma
    return float(spring * (left - right) + force)


def remaining_s(
    engine: Engine, stroke: Stroke, path: Path, *, x: float, v: float, tau: float
) -> float:
    """Time until this stroke ends if nothing disturbs it.

    A motion that creeps to rest has no end; it counts as half a period of the air springs.
    """
    omega = math.sqrt(stiffness_n_m(engine, stroke.energy_j) / engine.mass_kg)
    part = math.pi / omega / 16.0
    total = 0.0
    for _ in range(_SEARCH_STEPS):
        x, v, used, stop = advance(
            path, x, v, tau, part, direction=stroke.direction, contact_m=engine.contact_m
        )
        total += used
        tau += used
        if stop != NO_STOP:
            return total
    return 16.0 * part
