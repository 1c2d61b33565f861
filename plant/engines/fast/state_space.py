"""The linear engine as control engineering writes it: matrices, poles, transfer function.

x_dot = A x + B u, y = C x + D u, state (position, velocity), input force, output position
(docs/model.md, eqs. 17 to 20; thesis eqs. 5.61 to 5.77).
"""

from __future__ import annotations

import importlib
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.errors import ConfigError, MissingExtraError
from plant.engines.fast.combustion import energy_j, stiffness_n_m
from plant.engines.fast.constants import Constants
from plant.engines.fast.linear import evaluate, segment

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]


class StateSpace(NamedTuple):
    """Matrices of shapes (2, 2), (2, 1), (1, 2), (1, 1); a period of 0 means continuous time."""

    a: Array
    b: Array
    c: Array
    d: Array
    dt_s: float = 0.0


class LinearModel(NamedTuple):
    """m x'' + c x' + k x = u     (thesis eq. 5.7)."""

    mass_kg: float
    damping_n_s_m: float
    stiffness_n_m: float


def linear_model(
    constants: Constants, fuel_kg: float, load_coefficient_n_s_m: float
) -> LinearModel:
    """Linearise the engine about mid-stroke; no fuel gives the unfired engine.

    Raises: ConfigError when fuel or load is negative
    """
    if fuel_kg < 0.0 or load_coefficient_n_s_m < 0.0:
        raise ConfigError("linear model: fuel and load coefficient must not be negative")
    k = stiffness_n_m(constants, energy_j(constants, fuel_kg))
    return LinearModel(constants.mass_kg, load_coefficient_n_s_m, k)


def state_space(model: LinearModel) -> StateSpace:
    """A = [[0, 1], [-k/m, -c/m]], B = [[0], [1/m]], C = [[1, 0]], D = 0     (thesis eq. 5.71)."""
    m, c, k = model
    return StateSpace(
        np.array([[0.0, 1.0], [-k / m, -c / m]]),
        np.array([[0.0], [1.0 / m]]),
        np.array([[1.0, 0.0]]),
        np.array([[0.0]]),
    )


def discrete(model: LinearModel, dt_s: float) -> StateSpace:
    """Exact zero-order hold: Ad = e^(A dt), Bd = A^-1 (Ad - I) B.

    The columns of Ad are the free responses from unit position and from unit velocity.

    Raises: ConfigError when dt_s is not positive
    """
    if not dt_s > 0.0:
        raise ConfigError(f"sample period {dt_s:g} s must be positive")
    columns = [_free(model, x, v, dt_s) for x, v in ((1.0, 0.0), (0.0, 1.0))]
    ad = np.array(columns).T
    bd = np.array([[1.0 - ad[0, 0]], [-ad[1, 0]]]) / model.stiffness_n_m
    continuous = state_space(model)
    return StateSpace(ad, bd, continuous.c, continuous.d, dt_s)


def _free(model: LinearModel, x: float, v: float, t: float) -> tuple[float, float]:
    m, c, k = model
    return evaluate(segment(m, c, k, force_n=0.0, sine_n=0.0, x=x, v=v, tau=0.0), t)


def transfer_function(model: LinearModel) -> tuple[Array, Array]:
    """Return G(s) = 1 / (m s^2 + c s + k), numerator and denominator     (thesis eq. 5.73)."""
    return np.array([1.0]), np.array(model)


def poles(model: LinearModel) -> NDArray[np.complex128]:
    """Return s = (-c +- sqrt(c^2 - 4 m k)) / (2 m), shape (2,) [1/s]     (thesis eq. 5.75)."""
    m, c, k = model
    root = np.sqrt(np.complex128(c * c - 4.0 * m * k))
    return np.array([(-c + root) / (2.0 * m), (-c - root) / (2.0 * m)])


def natural_frequency_rad_s(model: LinearModel) -> float:
    """Return omega_n = sqrt(k/m)     (thesis eq. 5.58)."""
    return math.sqrt(model.stiffness_n_m / model.mass_kg)


def damping_ratio(model: LinearModel) -> float:
    """Return zeta = c / (2 sqrt(k m))     (thesis eqs. 5.81, 5.84)."""
    return model.damping_n_s_m / (2.0 * math.sqrt(model.stiffness_n_m * model.mass_kg))


def critical_load_n_s_m(model: LinearModel) -> float:
    """Load above which the motion is overdamped, c^2 = 4 m k     (the limit of thesis eq. 5.76)."""
    return 2.0 * math.sqrt(model.stiffness_n_m * model.mass_kg)


def frequency_response(model: LinearModel, omega_rad_s: Array) -> NDArray[np.complex128]:
    """Return G(i omega) = 1 / (k - m omega^2 + i c omega), of the shape of omega [m/N]."""
    m, c, k = model
    found: NDArray[np.complex128] = np.reciprocal(k - m * omega_rad_s**2 + 1j * c * omega_rad_s)
    return found


def step_response(model: LinearModel, t_s: Array) -> Array:
    """Position after a force of 1 N from rest at mid-stroke, of the shape of t [m]."""
    m, c, k = model
    start = segment(m, c, k, force_n=1.0, sine_n=0.0, x=0.0, v=0.0, tau=0.0)
    return np.array([evaluate(start, float(t))[0] for t in t_s])


def root_locus(model: LinearModel, loads_n_s_m: Array) -> NDArray[np.complex128]:
    """Both poles over the load, shape (2, loads) [1/s]."""
    found = np.empty((2, len(loads_n_s_m)), dtype=np.complex128)
    for n, c in enumerate(loads_n_s_m):
        found[:, n] = poles(model._replace(damping_n_s_m=float(c)))
    return found


def stable(model: LinearModel) -> bool:
    """Tell whether both poles lie in the left half plane: m, c and k all positive.

    The printed condition 5.76, c^2 > 4 m k, is that of an overdamped system.
    """
    return all(value > 0.0 for value in model)


def as_control_system(model: LinearModel, dt_s: float = 0.0) -> control.StateSpace:
    """Return the model as a python-control StateSpace, continuous unless a period is given.

    Raises: MissingExtraError when python-control is not installed
    """
    try:
        library = importlib.import_module("control")
    except ImportError as error:
        raise MissingExtraError("python-control", "desk", "a control system object") from error
    space = discrete(model, dt_s) if dt_s else state_space(model)
    return library.ss(space.a, space.b, space.c, space.d, dt_s)
