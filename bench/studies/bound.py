"""The physical bound: the least TDC error that any choice of fuel leaves after a disturbance.

Fuel can change once a stroke, at its dead centre, and what has not happened yet is not known.
With full knowledge of engine and load the best is exact deadbeat: at each dead centre the fuel
whose stroke ends at the set point under the load that then acts. Computed by the plant's own
equations, stroke by stroke, without ticks, wire or sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from bench.judge.response import Response
from hil.errors import ConfigError
from plant.engines.fast.combustion import Burn, energy_j
from plant.engines.fast.constants import Constants
from plant.engines.fast.limit_cycle import fuel_for_tdc
from plant.engines.fast.linear import NO_STOP
from plant.engines.fast.paths import advance, path_of

FUEL_RANGE_KG = (0.2e-6, 6.0e-6)
"""What an injector can give (thesis section 6.3 uses a narrower window for one case)."""

Informed = Literal["full", "mid-stroke"]
Knowledge = Informed | Literal["none"]

_PART_S = 2.0e-3
_LONGEST_S = 0.5
_SECANT_STEPS = 60


class LoadChange(NamedTuple):
    """From `at_s` after the first stroke's dead centre on, the load coefficient is this."""

    at_s: float
    load_n_s_m: float


class _End(NamedTuple):
    """The end of a stroke: distance [m], duration [s], load at its mid-stroke [N s/m]."""

    tdc_m: float
    duration_s: float
    load_at_mid: float


def stroke_end(
    constants: Constants, start_m: float, fuel_kg: float, loads: Sequence[LoadChange],
    efficiency: float = 1.0,
) -> _End:  # fmt: skip
    """Move through one whole stroke from a dead centre, the load changing where it is told to.

    Parameters: loads : changes in order, at_s from this dead centre, the first at or before 0
    Raises: ConfigError when the stroke has no end
    """
    energy = energy_j(constants, fuel_kg, efficiency)
    burn = Burn(1, energy)
    x, v, tau, load_at_mid = -start_m, 0.0, 0.0, loads[0].load_n_s_m
    for change, following in zip(loads, (*loads[1:], LoadChange(_LONGEST_S, 0.0)), strict=True):
        if following.at_s <= tau:
            continue
        path = path_of(constants, burn, change.load_n_s_m, 0.0, x=x, v=v, tau=tau)
        while tau < following.at_s:
            part = min(_PART_S, following.at_s - tau)
            was = x
            x, v, used, stop = advance(path, x, v, tau, part, direction=1, contact_m=1.0)
            tau += used
            if was < 0.0 <= x:
                load_at_mid = change.load_n_s_m
            if stop != NO_STOP:
                return _End(x, tau, load_at_mid)
    raise ConfigError(f"a stroke on {fuel_kg * 1e6:g} mg does not end")


def deadbeat_fuel(
    constants: Constants, start_m: float, target_m: float, load_n_s_m: float,
    limits_kg: tuple[float, float] = FUEL_RANGE_KG,
) -> float:  # fmt: skip
    """The fuel whose stroke from `start_m` ends at `target_m`, or the limit nearest to it [kg]."""
    loads = (LoadChange(0.0, load_n_s_m),)

    def lack(fuel_kg: float) -> float:
        return target_m - stroke_end(constants, start_m, fuel_kg, loads).tdc_m

    low, high = limits_kg
    lack_low, lack_high = lack(low), lack(high)
    if lack_low <= 0.0:
        return low
    if lack_high >= 0.0:
        return high
    for _ in range(_SECANT_STEPS):
        # Regula falsi with the Illinois rule: the retained end counts half.
        fuel = (low * lack_high - high * lack_low) / (lack_high - lack_low)
        found = lack(fuel)
        if abs(found) < 1e-10:
            return fuel
        if found > 0.0:
            low, lack_low, lack_high = fuel, found, 0.5 * lack_high
        else:
            high, lack_high, lack_low = fuel, found, 0.5 * lack_low
    return 0.5 * (low + high)


def bound(
    constants: Constants,
    tdc_ref_m: float,
    load_n_s_m: float,
    changes: Sequence[LoadChange],
    *,
    knowledge: Knowledge = "full",
    strokes: int = 12,
    efficiencies: Sequence[float] = (),
    limits_kg: tuple[float, float] = FUEL_RANGE_KG,
) -> Response:
    """Least TDC errors after disturbances that begin within a stroke of the settled engine.

    Parameters: load_n_s_m : load until the first change; changes : in order, at_s from the dead
    centre at which the first stroke begins; knowledge : `full` decides at the dead centre,
    `mid-stroke` at the middle of the stroke before, `none` keeps the fuel; efficiencies : of the
    combustions from the first stroke's on, 1 where there are no more, never known beforehand
    Raises: ConfigError when there is no settled motion to begin with
    """
    fuel = fuel_for_tdc(constants, tdc_ref_m, load_n_s_m)
    start, t, begun = tdc_ref_m, 0.0, changes[0].at_s if changes else 0.0
    times, errors, fuels = [], [], []
    for index in range(strokes):
        loads = _from(changes, load_n_s_m, t)
        eta = efficiencies[index] if index < len(efficiencies) else 1.0
        end = stroke_end(constants, start, fuel, loads, eta)
        t += end.duration_s
        fuel = _chosen(constants, knowledge, start, fuel, end, _from(changes, load_n_s_m, t),
                       tdc_ref_m, limits_kg)  # fmt: skip
        times.append(t - begun)
        errors.append((end.tdc_m - tdc_ref_m) * 1e3)
        fuels.append(fuel)
        start = end.tdc_m
    return Response(tuple(times), tuple(errors), fuel_kg=tuple(fuels))


def _from(changes: Sequence[LoadChange], before: float, t: float) -> tuple[LoadChange, ...]:
    """The loads counted from the instant t: the one in force, then those to come."""
    past = [change.load_n_s_m for change in changes if change.at_s <= t]
    later = [
        LoadChange(change.at_s - t, change.load_n_s_m) for change in changes if change.at_s > t
    ]
    return (LoadChange(0.0, past[-1] if past else before), *later)


def _chosen(
    constants: Constants, knowledge: Knowledge, start_m: float, fuel_kg: float, end: _End,
    loads: Sequence[LoadChange], target_m: float, limits_kg: tuple[float, float],
) -> float:  # fmt: skip
    """The fuel for the stroke that begins at `end`, by what is known when it is chosen."""
    if knowledge == "none":
        return fuel_kg
    if knowledge == "full":
        return deadbeat_fuel(constants, end.tdc_m, target_m, loads[0].load_n_s_m, limits_kg)
    believed = end.load_at_mid
    if believed == loads[0].load_n_s_m:
        reached = end.tdc_m
    else:
        # The load changes behind mid-stroke: until then all is as if it did not.
        reached = stroke_end(constants, start_m, fuel_kg, (LoadChange(0.0, believed),)).tdc_m
    return deadbeat_fuel(constants, reached, target_m, believed, limits_kg)


def step_bound(
    constants: Constants, tdc_ref_m: float, load_n_s_m: float, scale: float, fraction: float,
    knowledge: Knowledge = "full", strokes: int = 12,
) -> Response:  # fmt: skip
    """The bound after a load step at a fraction of the undisturbed stroke."""
    fuel = fuel_for_tdc(constants, tdc_ref_m, load_n_s_m)
    duration = stroke_end(constants, tdc_ref_m, fuel, (LoadChange(0.0, load_n_s_m),)).duration_s
    change = LoadChange(fraction * duration, scale * load_n_s_m)
    return bound(constants, tdc_ref_m, load_n_s_m, (change,), knowledge=knowledge, strokes=strokes)
