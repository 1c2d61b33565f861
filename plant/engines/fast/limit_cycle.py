"""The settled motion of each model: amplitude, frequency and mid-stroke velocity, both ways.

Pure functions for set-up and analysis; they know no head unless the model itself has one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from hil.errors import ConfigError
from hil.roots import bisect, secant
from plant.engines.fast.combustion import Burn, energy_j, force_n, sine_force_n, stiffness_n_m
from plant.engines.fast.constants import Constants
from plant.engines.fast.linear import DEAD_CENTRE, NO_STOP
from plant.engines.fast.nonlinear import CONTACT_GAP_M, GasPath, advance
from plant.engines.fast.paths import CLOSED_FORM, HARMONIC, NONLINEAR, RECTANGULAR, gas_path

_SCAN = 64
_FUEL_RANGE_KG = (1.0e-8, 1.0e-4)
_SECANT_STEPS = 25
_REACHED_M = 1.0e-6


class LimitCycle(NamedTuple):
    """A settled motion: TDC from mid-stroke, strokes come at twice `frequency_hz`."""

    tdc_m: float
    frequency_hz: float
    v_mid_m_s: float


def limit_cycle(constants: Constants, fuel_kg: float, load_coefficient_n_s_m: float) -> LimitCycle:
    """Return the settled motion on that fuel and load.

    Raises: ConfigError when there is none: no load, too much damping, or (non-linear model) no
    motion inside the stroke
    """
    c = load_coefficient_n_s_m
    if c <= 0.0:
        raise ConfigError(f"load coefficient {c:g} N s/m: a settled motion needs one above 0")
    if fuel_kg <= 0.0:
        raise ConfigError(f"fuel {fuel_kg:g} kg: a settled motion needs some")
    solve = _SOLVERS[constants.model]
    return solve(constants, fuel_kg, c)


def harmonic_cycle(constants: Constants, fuel_kg: float, c: float) -> LimitCycle:
    """X = F0 / (c omega_n)     (thesis eqs. 5.60, 6.1, 6.2)."""
    energy = energy_j(constants, fuel_kg)
    omega = math.sqrt(stiffness_n_m(constants, energy) / constants.mass_kg)
    tdc = sine_force_n(constants, energy) / (c * omega)
    return LimitCycle(tdc, omega / (2.0 * math.pi), tdc * omega)


def rectangular_cycle(constants: Constants, fuel_kg: float, c: float) -> LimitCycle:
    """X = (F/k) coth(pi zeta / (2 sqrt(1 - zeta^2))) at omega_d     (docs/model.md, eq. 13)."""
    energy = energy_j(constants, fuel_kg)
    m, k = constants.mass_kg, stiffness_n_m(constants, energy)
    decay = c / (2.0 * m)
    if decay * decay >= k / m:
        raise ConfigError(f"load coefficient {c:g} N s/m: no oscillation, damping is critical")
    omega_d = math.sqrt(k / m - decay * decay)
    offset = force_n(constants, energy) / k
    tdc = offset / math.tanh(math.pi * decay / (2.0 * omega_d))
    # From -X the distance to the centre of pull is X + offset; the free response at x = 0 follows
    # from one equation in the phase.
    quarter = _phase_of_mid_stroke(tdc + offset, offset, decay, omega_d)
    speed = (tdc + offset) * (k / m) / omega_d
    v_mid = speed * math.exp(-decay * quarter / omega_d) * math.sin(quarter)
    return LimitCycle(tdc, omega_d / (2.0 * math.pi), v_mid)


def _phase_of_mid_stroke(start: float, offset: float, decay: float, omega_d: float) -> float:
    """Solve e^(-a t)(cos + (a/wd) sin) start = offset for the phase wd t in (0, pi)."""

    def excess(phase: float) -> float:
        ratio = decay / omega_d
        swing = math.cos(phase) + ratio * math.sin(phase)
        return start * math.exp(-ratio * phase) * swing - offset

    return bisect(excess, 0.0, math.pi)


def nonlinear_cycle(constants: Constants, fuel_kg: float, c: float) -> LimitCycle:
    """Find the amplitude that one stroke of eqs. 5.21, 5.22 reproduces, by bisection."""
    energy = energy_j(constants, fuel_kg)
    largest = constants.half_stroke_m - 2.0 * CONTACT_GAP_M

    def loss(tdc: float) -> float:
        return tdc - _stroke_reach(constants, energy, c, tdc)[0]

    low = 1.0e-3 * largest
    for part in range(1, _SCAN + 1):
        high = largest * part / _SCAN
        if loss(high) >= 0.0 >= loss(low):
            tdc = bisect(lambda x: -loss(x), low, high)
            _, duration, v_mid = _stroke_reach(constants, energy, c, tdc)
            return LimitCycle(tdc, 0.5 / duration, v_mid)
        low = high
    raise ConfigError(
        f"fuel {fuel_kg * 1e6:g} mg at {c:g} N s/m: the non-linear model has no settled motion "
        "inside the stroke"
    )


def _amplitude(constants: Constants, fuel_kg: float, c: float) -> float:
    """Amplitude on that fuel, nought where the damping lets nothing oscillate."""
    try:
        return limit_cycle(constants, fuel_kg, c).tdc_m
    except ConfigError:
        return 0.0


def power_w(constants: Constants, fuel_kg: float, cycle: LimitCycle) -> float:
    """Mean electric power of a settled motion, from the work of a charge over one stroke.

    W = 2 E X / Ls of either linear excitation (docs/model.md, eqs. 10, 12), and of the gas force
    W = E Ls^(gamma-1) [(Ls - X)^(1-gamma) - (Ls + X)^(1-gamma)] / (gamma - 1); the air springs
    give back what they take, and the load takes all of it.
    """
    energy, size, tdc = energy_j(constants, fuel_kg), constants.half_stroke_m, cycle.tdc_m
    work = 2.0 * energy * tdc / size
    if constants.model == NONLINEAR:
        n = constants.gamma - 1.0
        work = energy * size**n / n * ((size - tdc) ** -n - (size + tdc) ** -n)
    return 2.0 * cycle.frequency_hz * work


def _stroke_reach(
    constants: Constants, energy: float, c: float, tdc_m: float
) -> tuple[float, float, float]:
    """Integrate one stroke from the left dead centre: (end position, duration, speed at x = 0)."""
    path = gas_path(constants, Burn(1, energy), c, 0.0)
    x, v, t, v_mid = -tdc_m, 0.0, 0.0, 0.0
    for _ in range(100_000):
        x1, v1, used, stop = advance(path, x, v, 1.0e-3, 1)
        if x < 0.0 <= x1:
            v_mid = _speed_at_mid_stroke(path, x, v, used)
        x, v, t = x1, v1, t + used
        if stop != NO_STOP:
            return (x if stop == DEAD_CENTRE else constants.half_stroke_m), t, v_mid
        if abs(v) < 1.0e-9:
            break
    return x, t, v_mid


def _speed_at_mid_stroke(path: GasPath, x: float, v: float, dt: float) -> float:
    def behind(h: float) -> float:
        return -advance(path, x, v, h, 1)[0]

    return advance(path, x, v, bisect(behind, 0.0, dt), 1)[1]


_SOLVERS: dict[str, Callable[[Constants, float, float], LimitCycle]] = {
    CLOSED_FORM: harmonic_cycle,
    HARMONIC: harmonic_cycle,
    RECTANGULAR: rectangular_cycle,
    NONLINEAR: nonlinear_cycle,
}


def fuel_for_tdc(constants: Constants, tdc_m: float, load_coefficient_n_s_m: float) -> float:
    """Return the fuel whose settled motion reaches `tdc_m`, to about 1e-15 kg.

    Raises: ConfigError when no fuel between 0.01 and 100 mg does
    """
    c = load_coefficient_n_s_m

    def lack(fuel_kg: float) -> float:
        if constants.model != NONLINEAR:
            return tdc_m - _amplitude(constants, fuel_kg, c)
        return tdc_m - _stroke_reach(constants, energy_j(constants, fuel_kg), c, tdc_m)[0]

    low, high = _FUEL_RANGE_KG
    if not lack(low) > 0.0 > lack(high):
        raise ConfigError(f"tdc {tdc_m * 1e3:g} mm: no fuel reaches it at {c:g} N s/m")
    fuel = __bisect_fuel(lack, low, high)
    if abs(limit_cycle(constants, fuel, c).tdc_m - tdc_m) > 1.0e-6:
        raise ConfigError(f"tdc {tdc_m * 1e3:g} mm: no stable motion there at {c:g} N s/m")
    return fuel


def steady_at(constants: Constants, tdc_m: float, load_n_s_m: float) -> tuple[float, LimitCycle]:
    """Return fuel and settled motion at `tdc_m`, quickly: to about a millionth of the fuel.

    Raises: ConfigError as `fuel_for_tdc` and `limit_cycle` do
    """
    if constants.model != NONLINEAR:
        fuel_kg = fuel_for_tdc(constants, tdc_m, load_n_s_m)
        return fuel_kg, limit_cycle(constants, fuel_kg, load_n_s_m)

    def lack(fuel_kg: float) -> float:
        return tdc_m - _stroke_reach(constants, energy_j(constants, fuel_kg), load_n_s_m, tdc_m)[0]

    guess_kg = math.pi * load_n_s_m * tdc_m**2 * _omega(constants) / (4.0 * constants.energy_j_kg)
    fuel_kg = secant(lack, guess_kg, steps=_SECANT_STEPS, relative=1.0e-7)
    if abs(lack(fuel_kg)) > _REACHED_M:
        raise ConfigError(f"tdc {tdc_m * 1e3:g} mm: no fuel reaches it at {load_n_s_m:g} N s/m")
    energy = energy_j(constants, fuel_kg)
    _, duration, v_mid = _stroke_reach(constants, energy, load_n_s_m, tdc_m)
    return fuel_kg, LimitCycle(tdc_m, 0.5 / duration, v_mid)


def _omega(constants: Constants) -> float:
    return math.sqrt(constants.rest_stiffness_n_m / constants.mass_kg)


def __bisect_fuel(f: Callable[[float], float], low: float, high: float) -> float:
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if f(middle) > 0.0 else (low, middle)
    return math.sqrt(low * high)


class FuelCurve(NamedTuple):
    """Amplitude and speed over fuel, as thesis Fig 6.2 shows them."""

    fuel_kg: tuple[float, ...]
    tdc_m: tuple[float, ...]
    speed_rpm: tuple[float, ...]


def fuel_curve(
    constants: Constants, fuels_kg: Sequence[float], load_coefficient_n_s_m: float
) -> FuelCurve:
    """Evaluate eqs. 6.1 and 6.2 over fuel, heads ignored; a cycle counts as one revolution."""
    cycles = [harmonic_cycle(constants, fuel, load_coefficient_n_s_m) for fuel in fuels_kg]
    return FuelCurve(
        tuple(fuels_kg),
        tuple(cycle.tdc_m for cycle in cycles),
        tuple(60.0 * cycle.frequency_hz for cycle in cycles),
    )
