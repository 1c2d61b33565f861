"""Extended state observer: velocity, load and charge from position and velocity alone.

m v' = q f [(1 - h) + h (4/pi) sin(omega tau)] - (k0 + k_q q) z - c v,  c' = 0,  q' = 0

a Kalman filter of three states, exact in v between two samples because z is measured. The charge
is drawn anew at each dead centre, where v is nought; the load drifts, and jumps where nothing
else explains what is seen (after the controllers of FPEC and the later literature, thesis
chapter 2). The fuel is deadbeat, and trimmed until it has flowed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.laws import charge
from controller.laws.charge import NOTHING_FORESEEN, Charge, Forecast
from controller.laws.engine_map import EngineMap, load_of_cycle, travel
from controller.laws.interface import (
    NO_TRIM,
    Demand,
    Handover,
    Law,
    StrokeFacts,
    TickFacts,
    Trim,
)
from controller.laws.pdf import at_dead_centre, fuel_after
from hil.config.controller import ControllerConfig, ObserverConfig

_SINE = 4.0 / math.pi
_LEAST, _MOST = 0.2, 4.0
_WORST_SHARE = 9.0
_END_MOVED_M = 20e-6


class Covariance(NamedTuple):
    """Of velocity, load and charge: [m2/s2, (N s/m)2, kg2] and their products."""

    vv: float = 0.0
    vc: float = 0.0
    vq: float = 0.0
    cc: float = 400.0
    cq: float = 0.0
    qq: float = 0.0


class ObserverState(NamedTuple):
    """Estimates with their covariance; z of the sample before; what the fuel was set for.

    begun: whether this stroke has been followed from its dead centre on
    """

    v: float = 0.0
    c: float = 0.0
    q: float = 0.0
    p: Covariance = Covariance()
    z: float = 0.0
    noise_m2_s2: float = 1e-6
    begun: bool = False
    charge: Charge = Charge()
    forecast: Forecast = NOTHING_FORESEEN
    fuel_for_n_s_m: float = 0.0
    fuel_for_m: float = 0.0


def step(
    config: ControllerConfig, state: ObserverState, facts: StrokeFacts
) -> tuple[ObserverState, Demand]:
    """The steady fuel, until the watch trims it in the same tick."""
    fuel = charge.first_fuel(state.charge, facts)
    return state._replace(fuel_for_n_s_m=0.0), Demand(fuel, facts.point.v_mid_m_s)


def watch(
    config: ControllerConfig, state: ObserverState, facts: TickFacts
) -> tuple[ObserverState, Trim]:
    """Follow the motion by one tick; at the dead centre begin anew; trim the fuel."""
    motion = facts.motion
    direction = motion.direction
    if facts.passed.dead_centre:
        return _begin(config, state, facts), NO_TRIM
    if not state.begun:
        return state, NO_TRIM
    z, v = direction * motion.x_m, direction * motion.v_m_s
    model = state.charge.model or facts.model
    state = follow(config.observer, model, state, z, v, facts.tau_s, facts.dt_s)
    if not _LEAST * facts.load_n_s_m < state.c < _MOST * facts.load_n_s_m:
        state = state._replace(c=facts.load_n_s_m, p=Covariance(qq=state.p.qq))
    if facts.planned_kg == 0.0 or not state.charge.known:
        return state, NO_TRIM
    end, _ = travel(model, state.q, state.c, z, state.v, facts.tau_s)
    same_load = abs(state.c - state.fuel_for_n_s_m) <= config.load_estimate.retrim * state.c
    if same_load and abs(end - state.fuel_for_m) <= _END_MOVED_M:
        return state, NO_TRIM
    fuel = fuel_after(facts, state.charge, state.c, end)
    return state._replace(fuel_for_n_s_m=state.c, fuel_for_m=end), Trim(fuel)


def _begin(config: ControllerConfig, state: ObserverState, facts: TickFacts) -> ObserverState:
    """At a dead centre: v was nought there, the charge is what was asked for, more or less."""
    motion = facts.motion
    if not state.charge.known:
        state = _aligned(config, state, facts)
    c = state.c or facts.load_n_s_m
    learnt, forecast = at_dead_centre(
        config, state.charge, state.forecast, facts, c, state.fuel_for_m
    )
    q = charge.effective(learnt, motion.side, facts.burnt_kg[motion.side])
    spread = config.observer.charge_spread * q
    p = Covariance(cc=state.p.cc, qq=spread * spread)
    begun = state._replace(
        v=0.0, c=c, q=q, p=p, z=-motion.tdc_m, begun=True, charge=learnt, forecast=forecast,
        fuel_for_n_s_m=0.0, fuel_for_m=0.0,
    )  # fmt: skip
    z, v = motion.direction * motion.x_m, motion.direction * motion.v_m_s
    model = learnt.model or facts.model
    return follow(config.observer, model, begun, z, v, facts.tau_s, facts.tau_s)


def _aligned(config: ControllerConfig, state: ObserverState, facts: TickFacts) -> ObserverState:
    """After a change of law: the load under which the fuel in force holds the set point.

    Load and charge cannot both be told from a steady state; the charge is believed.
    """
    burnt, tdc_m = facts.burnt_kg, facts.motion.tdc_m
    known = state.charge._replace(known=True)
    if abs(tdc_m - facts.tdc_ref_m) >= config.learning.near_m or min(burnt) <= 0.0:
        return state._replace(charge=known)
    mean = 0.5 * (burnt[0] + burnt[1])
    c = load_of_cycle(facts.model, mean, facts.tdc_ref_m, facts.load_n_s_m)
    share = (mean / burnt[0], mean / burnt[1])
    return state._replace(c=c, charge=known._replace(share=share))


def follow(
    config: ObserverConfig, model: EngineMap, state: ObserverState, z: float, v: float,
    tau: float, dt: float,
) -> ObserverState:  # fmt: skip
    """One tick of the filter: predict over dt up to tau, correct by the velocity measured."""
    if dt <= 0.0:
        return state._replace(z=z)
    m, c, q, noise = model.m, state.c, state.q, state.noise_m2_s2
    k = model.k0 + model.k_q * q
    middle = 0.5 * (state.z + z) + dt * (state.v - v) / 12.0
    phase = math.sqrt(k / m) * (tau - 0.5 * dt)
    push = model.f * (1.0 - model.h + model.h * _SINE * math.sin(phase))
    a = (state.z - z) / m
    b = dt / m * (push - model.k_q * middle)
    predicted = state.v + dt / m * (push * q - k * middle) + a * c
    e = v - predicted
    p = _carried(state.p, a, b, config)
    s = p.vv + noise
    seen = abs(e) > config.step_min_m_s and abs(v) > config.slowest_m_s
    if seen and e * e > config.gate * config.gate * s:
        jump = config.load_jump * c
        p = p._replace(
            vv=p.vv + a * a * jump * jump, vc=p.vc + a * jump * jump, cc=p.cc + jump * jump
        )
        s = p.vv + noise
    spread = min(e * e, _WORST_SHARE * noise)
    floor = config.noise_floor_m_s * config.noise_floor_m_s
    gv, gc, gq = p.vv / s, p.vc / s, p.vq / s
    return state._replace(
        v=predicted + gv * e,
        c=max(c + gc * e, 1.0),
        q=max(q + gq * e, 1e-9),
        p=Covariance(
            p.vv - gv * p.vv, p.vc - gv * p.vc, p.vq - gv * p.vq,
            p.cc - gc * p.vc, p.cq - gc * p.vq, p.qq - gq * p.vq,
        ),
        z=z,
        noise_m2_s2=max(noise + config.noise_gain * (spread - noise), floor),
    )  # fmt: skip


def _carried(p: Covariance, a: float, b: float, config: ObserverConfig) -> Covariance:
    """The covariance a tick later: v takes up a times the load's error and b times the charge's."""
    vv, vc, vq, cc, cq, qq = p
    vv += 2.0 * (a * vc + b * vq) + a * a * cc + 2.0 * a * b * cq + b * b * qq
    vv += config.drift_m_s * config.drift_m_s
    cc_after = cc + config.drift_n_s_m * config.drift_n_s_m
    return Covariance(vv, vc + a * cc + b * cq, vq + a * cq + b * qq, cc_after, cq, qq)


def take_over(config: ControllerConfig, handover: Handover) -> ObserverState:
    """Know little of the load, and align the shares with the fuel in force."""
    return ObserverState(p=Covariance(cc=100.0), charge=Charge(known=False))


def after_restart(state: ObserverState) -> ObserverState:
    """Keep what was learnt; follow the motion from the next dead centre on."""
    return state._replace(
        begun=False, forecast=NOTHING_FORESEEN, fuel_for_n_s_m=0.0, fuel_for_m=0.0
    )


LAW = Law(
    "observer", ObserverState(), step, watch, take_over, after_restart, needs_model=True,
    needs_fit=True,
)  # fmt: skip
