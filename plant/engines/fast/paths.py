"""The four models behind one interface: make a path for a stroke, move along it."""

from __future__ import annotations

import math

from plant.engines.fast import linear, nonlinear
from plant.engines.fast.combustion import Burn, force_n, sine_force_n, stiffness_n_m
from plant.engines.fast.constants import Constants
from plant.engines.fast.linear import NO_STOP, UNDAMPED_BELOW_N_S_M, Segment
from plant.engines.fast.nonlinear import GasPath

CLOSED_FORM = "closed-form"
HARMONIC = "harmonic"
RECTANGULAR = "rectangular"
NONLINEAR = "nonlinear"

Path = Segment | GasPath

# A path is searched in sixteenths of half a period, for at most this many of them.
_SEARCH_STEPS = 16 * 40


def latches(constants: Constants, energy_j: float, c: float, force: float) -> bool:
    """Tell whether the stroke now starting is one of eq. 5.60, settled by its dead centre."""
    generating = c > UNDAMPED_BELOW_N_S_M and force == 0.0
    return constants.model == CLOSED_FORM and energy_j > 0.0 and generating


def path_of(
    constants: Constants, burn: Burn, c: float, force: float, *, x: float, v: float, tau: float
) -> Path:
    """Make the path from (x, v) at tau on, with damping c and constant force.

    Parameters: tau : float, time since the stroke's start [s]
    """
    energy = burn.energy_j
    if constants.model == NONLINEAR:
        return gas_path(constants, burn, c, force)
    k = stiffness_n_m(constants, energy)
    if burn.latched:
        omega = math.sqrt(k / constants.mass_kg)
        x_end = burn.direction * sine_force_n(constants, energy) / (c * omega)
        return linear.half_cosine(omega, x, x_end)
    sine = 0.0
    if constants.model == RECTANGULAR:
        force += burn.direction * force_n(constants, energy)
    else:
        sine = burn.direction * sine_force_n(constants, energy)
    return linear.segment(constants.mass_kg, c, k, force_n=force, sine_n=sine, x=x, v=v, tau=tau)


def gas_path(constants: Constants, burn: Burn, c: float, force: float) -> GasPath:
    """A p0 Ls^gamma, plus E Ls^(gamma-1) on the side that fired     (thesis eqs. 5.21, 5.22)."""
    gamma, size, m = constants.gamma, constants.half_stroke_m, constants.mass_kg
    spring = constants.area_m2 * constants.p0_pa * math.pow(size, gamma) / m
    burnt = burn.energy_j * math.pow(size, gamma - 1.0) / m
    left = spring + (burnt if burn.direction > 0 else 0.0)
    right = spring + (burnt if burn.direction < 0 else 0.0)
    return GasPath(left, right, -gamma, damping=c / m, push=force / m, half_stroke_m=size)


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


def net_force_n(constants: Constants, x: float, force: float) -> float:
    """Force on a piston at rest at x: the two air springs and the machine."""
    if constants.model != NONLINEAR:
        return force - constants.rest_stiffness_n_m * x
    size = constants.half_stroke_m
    spring = constants.area_m2 * constants.p0_pa * math.pow(size, constants.gamma)
    left, right = math.pow(size + x, -constants.gamma), math.pow(size - x, -constants.gamma)
    return spring * (left - right) + force


def remaining_s(
    constants: Constants, burn: Burn, path: Path, *, x: float, v: float, tau: float
) -> float:
    """Time until this stroke ends if nothing disturbs it.

    A motion that creeps to rest has no end; it counts as half a period of the air springs.
    """
    omega = math.sqrt(stiffness_n_m(constants, burn.energy_j) / constants.mass_kg)
    part = math.pi / omega / 16.0
    total = 0.0
    for _ in range(_SEARCH_STEPS):
        x, v, used, stop = advance(
            path, x, v, tau, part, direction=burn.direction, contact_m=constants.contact_m
        )
        total += used
        tau += used
        if stop != NO_STOP:
            return total
    return 16.0 * part
