"""Predictive: the load inferred from this stroke's mid-stroke velocity, then deadbeat fuel.

The load c that explains v_mid gives the dead centre X ahead (TDC predicted from the velocity as
compression begins, Mikalsen and Roskilly), and the fuel that takes the next stroke from X to the
set point. Called once a stroke; only position and velocity are measured.
"""

from __future__ import annotations

from typing import NamedTuple

from controller.laws.engine_map import EngineMap, charge_for, load_behind, pass_mid, travel
from controller.laws.interface import Demand, Handover, Law, StrokeFacts
from hil.config.controller import ControllerConfig, LearningConfig, PredictiveConfig

_CALM = 3
_LEAST, _MOST = 0.2, 4.0
_WORST_SHARE = 9.0
_TRUST = 100.0
_DOUBTFUL = 2.0
"""A load told from one speed is noisier than a measured one: so much more is a change."""


class PredictiveState(NamedTuple):
    """Load inferred last (0: none yet), shares of the fuel by side, error of the map [m].

    variance, noise: of the load as a share, and of one inference of it
    seen: inferences of the stroke before and of the one before that
    end_m: dead centre that was predicted (0: none); offset_before_m: to undo the last lesson
    calm: strokes since the load was seen to change; none of the first few teaches anything
    """

    load_n_s_m: float = 0.0
    share: tuple[float, float] = (1.0, 1.0)
    offset_m: float = 0.0
    offset_before_m: float = 0.0
    end_m: float = 0.0
    calm: int = _CALM
    variance: float = 1e-4
    noise: float = 4e-6
    seen: tuple[float, float] = (0.0, 0.0)
    known: bool = True


def step(
    config: ControllerConfig, state: PredictiveState, facts: StrokeFacts
) -> tuple[PredictiveState, Demand]:
    """Infer, predict, correct: the fuel for the combustion at the end of this stroke."""
    model = facts.model
    assert model is not None, "the law asks for a model"
    learning = config.learning
    if not state.known:
        state = _aligned(learning, state, facts, model)
    offset = state.offset_m
    if state.end_m > 0.0 and state.calm >= _CALM:
        offset = _within(offset + learning.gain * (facts.tdc_m - state.end_m), learning.offset_m)
    fired = 1 - facts.side
    q = max(state.share[fired] * facts.burnt_kg[fired], 1e-9)
    v_mid = facts.v_mid_m_s / model.speed
    seen = load_behind(model, q, facts.tdc_m, v_mid, state.load_n_s_m or facts.load_n_s_m)
    seen = min(max(seen, _LEAST * facts.load_n_s_m), _MOST * facts.load_n_s_m)
    before = state.load_n_s_m or seen
    excess = seen / before - 1.0
    # Two cylinders that differ alternate: what the same side has shown before is no load step.
    again = seen / state.seen[1] - 1.0 if state.seen[1] > 0.0 else excess
    news = min(abs(excess), abs(again))
    trust = 1.0 if model.fits else config.predictive.poor_map_trust
    c, variance, noise = _filtered(config.predictive, state, before, trust * excess, trust * news)
    share, calm = state.share, min(state.calm + 1, _CALM)
    if news > _DOUBTFUL * learning.load_change:
        offset, calm = state.offset_before_m, 0
    elif calm >= _CALM:
        share = _balanced(learning, share, fired, excess)
    _, tau = pass_mid(model, q, c, facts.tdc_m)
    end = travel(model, q, c, 0.0, v_mid, tau)[0] + offset
    wanted, _ = charge_for(model, c, end, facts.tdc_ref_m - offset, facts.point.fuel_kg)
    fuel = min(max(wanted / share[facts.side], facts.fuel_min_kg), facts.fuel_max_kg)
    demand = Demand(
        fuel, facts.point.v_mid_m_s, inner_p_kg=fuel - facts.point.fuel_kg,
        inner_i_kg=wanted / share[facts.side] - wanted,
    )  # fmt: skip
    after = PredictiveState(
        c,
        share,
        offset,
        state.offset_m,
        end,
        calm,
        variance=variance,
        noise=noise,
        seen=(seen, state.seen[0]),
    )
    return after, demand


def _filtered(
    config: PredictiveConfig, state: PredictiveState, before: float, excess: float, news: float
) -> tuple[float, float, float]:
    """The load, its variance and the noise of an inference: a Kalman filter, noise learnt.

    What the noise cannot explain is a change of the load, and is taken at once.
    """
    variance = state.variance + config.drift * config.drift
    square = news * news
    s = variance + state.noise
    if square > config.gate * config.gate * s:
        variance += square * _TRUST
        s = variance + state.noise
    gain = variance / s
    spread = min(square, _WORST_SHARE * state.noise)
    noise = state.noise + config.noise_gain * (spread - state.noise)
    noise = max(noise, config.noise_floor * config.noise_floor)
    return before * (1.0 + gain * excess), variance * (1.0 - gain), noise


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)


def _balanced(
    learning: LearningConfig, share: tuple[float, float], fired: int, excess: float
) -> tuple[float, float]:
    """A load that seems to alternate from stroke to stroke is a charge that does.

    Half of the alternation belongs to each side, with opposite signs; their mean stays.
    """
    less = 0.5 * learning.gain * excess
    moved = [s - less if side == fired else s + less for side, s in enumerate(share)]
    left, right = (min(max(s, learning.share_min), learning.share_max) for s in moved)
    return left, right


def _aligned(
    learning: LearningConfig, state: PredictiveState, facts: StrokeFacts, model: EngineMap
) -> PredictiveState:
    """After a change of law: the shares with which this law asks for the fuel in force.

    The load and the charge cannot both be told from a mid-stroke velocity; the commanded load is
    believed, and what remains is the charge.
    """
    near = abs(facts.tdc_m - facts.tdc_ref_m) < learning.near_m and min(facts.burnt_kg) > 0.0
    if not near:
        return state._replace(known=True)
    mean = 0.5 * (facts.burnt_kg[0] + facts.burnt_kg[1])
    left, right = (
        min(max(mean / m, learning.share_min), learning.share_max) for m in facts.burnt_kg
    )
    return state._replace(share=(left, right), known=True)


def take_over(config: ControllerConfig, handover: Handover) -> PredictiveState:
    """Align the shares with the fuel in force at the next step."""
    return PredictiveState(known=False)


def after_restart(state: PredictiveState) -> PredictiveState:
    """Keep what was learnt; the stroke under way was not predicted."""
    return state._replace(end_m=0.0, load_n_s_m=0.0)


LAW = Law(
    "predictive", PredictiveState(), step, take_over=take_over, after_restart=after_restart,
    needs_model=True,
)  # fmt: skip
