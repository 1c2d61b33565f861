"""What the model-based laws learn: the share of the fuel that acts, by cylinder, and the inertia.

A stroke that ends elsewhere than its model says had another charge than was believed. The share
of each cylinder moves by a part of that, so that imbalance, injector flow, heating value and the
errors of the model itself are taken up; in steady state the model then says what the engine does.
A stroke that takes longer than foreseen moves another mass over the same springs (T^2 ~ m / k).
"""

from __future__ import annotations

from typing import NamedTuple

from controller.laws.engine_map import EngineMap, charge_for, end_of, travel
from controller.laws.interface import StrokeFacts
from hil.config.controller import LearningConfig

_STEP = 0.01


class Charge(NamedTuple):
    """Effective fuel as a share of the fuel asked for, (left, right); `known` once aligned.

    model: the stroke's map with the inertia learnt, None before the first stroke
    ahead_m: error of the dead centre that is predicted at mid-stroke
    """

    share: tuple[float, float] = (1.0, 1.0)
    known: bool = True
    model: EngineMap | None = None
    ahead_m: float = 0.0


class Forecast(NamedTuple):
    """Where the stroke under way should end [m], dX/dq there [m/kg], under which load, and when.

    begun_ns, duration_s: when the stroke began and how long it should take
    """

    end_m: float = 0.0
    slope_m_kg: float = 0.0
    load_n_s_m: float = 0.0
    begun_ns: int = -1
    duration_s: float = 0.0


NOTHING_FORESEEN = Forecast()


def first_fuel(charge: Charge, facts: StrokeFacts) -> float:
    """The fuel of a stroke until the watch trims it [kg].

    That of the steady state; while the shares are still to be aligned, that burnt there last.
    """
    burnt = facts.burnt_kg[facts.side]
    if not charge.known and burnt > 0.0:
        fuel = burnt
    else:
        fuel = facts.point.fuel_kg / charge.share[facts.side]
    return min(max(fuel, facts.fuel_min_kg), facts.fuel_max_kg)


def effective(charge: Charge, side: int, fuel_kg: float) -> float:
    """Effective fuel of a charge [kg]."""
    return charge.share[side] * fuel_kg


def foresee(model: EngineMap, q: float, c: float, start_m: float, begun_ns: int) -> Forecast:
    """Forecast of a stroke that begins at the distance `start_m`."""
    end, duration_s = travel(model, q, c, -start_m, 0.0, 0.0)
    more = end_of(model, q * (1.0 + _STEP), c, start_m)
    return Forecast(end, (more - end) / (q * _STEP), c, begun_ns, duration_s)


def learn(
    config: LearningConfig, charge: Charge, side: int, fuel_kg: float, forecast: Forecast,
    tdc_m: float, c: float, t_ns: int, model: EngineMap,
) -> Charge:  # fmt: skip
    """Move the share of the side that fired towards what explains the dead centre.

    share += gain (X - X_foreseen) / (dX/dq m_fuel), m *= (T / T_foreseen)^(2 gain); a stroke within
    which the load has changed teaches nothing, nor does one without a charge.
    """
    usable = forecast.slope_m_kg > 0.0 and fuel_kg > 0.0
    if not usable or abs(c - forecast.load_n_s_m) > config.load_change * c:
        return charge
    wrong = (tdc_m - forecast.end_m) / (forecast.slope_m_kg * fuel_kg)
    wrong = min(max(wrong, -config.most), config.most)
    low, high = config.share_min, config.share_max
    moved = min(max(charge.share[side] + config.gain * wrong, low), high)
    share = (moved, charge.share[1]) if side == 0 else (charge.share[0], moved)
    longer = (t_ns - forecast.begun_ns) * 1e-9 / forecast.duration_s - 1.0
    longer = min(max(longer, -config.most), config.most)
    believed = charge.model or model
    m = believed.m * (1.0 + 2.0 * config.inertia_gain * longer)
    m = min(max(m, config.share_min * model.m), config.share_max * model.m)
    return charge._replace(share=share, model=believed._replace(m=m))


def look_back(config: LearningConfig, charge: Charge, wrong_m: float) -> Charge:
    """Take up the error of the dead centre that was predicted from mid-stroke."""
    ahead = charge.ahead_m + config.gain * wrong_m
    return charge._replace(ahead_m=min(max(ahead, -config.offset_m), config.offset_m))


def align(
    config: LearningConfig, charge: Charge, model: EngineMap, c: float, tdc_ref_m: float,
    tdc_m: float, burnt_kg: tuple[float, float],
) -> Charge:  # fmt: skip
    """After a change of law: the shares with which the model asks for the fuel in force.

    Only an engine near its set point shows them; one that is not begins with what was believed.
    """
    near = abs(tdc_m - tdc_ref_m) < config.near_m and min(burnt_kg) > 0.0
    if not near:
        return charge._replace(known=True)
    q, _ = charge_for(model, c, tdc_ref_m, tdc_ref_m, 0.5 * (burnt_kg[0] + burnt_kg[1]))
    left, right = (min(max(q / m, config.share_min), config.share_max) for m in burnt_kg)
    return charge._replace(share=(left, right), known=True)
