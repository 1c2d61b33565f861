"""Predictive: the load inferred from this stroke's mid-stroke velocity, then deadbeat fuel.

The load c that explains v_mid gives the dead centre X ahead (TDC predicted from the velocity as
compression begins, Mikalsen and Roskilly), and the fuel that takes the next stroke from X to the
set point. Called once a stroke; only position and velocity are measured.
"""

from __future__ import annotations

from typing import ClassVar, Final, final

from mypy_extensions import i64

from controller.motion.charge import Learning, is_near, shares_of
from controller.motion.law import Demand, Law, View
from controller.motion.load_estimate import NO_DRIFT, LoadDrift
from controller.motion.quiet import NOTHING_SEEN, Noise, Quiet
from hil.config.controller import ControllerConfig
from hil.config.motion.laws import PredictiveConfig
from hil.values import Value, replace

_CALM: Final = 3
_LEAST: Final = 0.2
_MOST: Final = 4.0
_WORST_SHARE: Final = 9.0
_TRUST: Final = 100.0
_NEXT: Final = 1.25
"""From the load inferred, which is that of a stroke's first half, to the next stroke's mean."""

_SAME_SPEED: Final = 0.02
"""Of the mid-stroke speed in the steady state: a map that is further off is a poor one."""


@final
class InferredLoad(Value):
    """The load inferred last (0: none yet), its variance as a share, noise of one inference.

    seen: inferences of the stroke before and of the one before that; drift: what a stroke adds;
    left: by what share the last one exceeded what was expected; slope: of the drift, what is no
    noise [N s/m]
    """

    __slots__ = ("c", "variance", "noise", "seen", "drift", "left", "slope")

    def __init__(
        self, c: float = 0.0, variance: float = 1e-4, noise: float = 4e-6,
        seen: tuple[float, float] = (0.0, 0.0), drift: LoadDrift = NO_DRIFT, left: float = 0.0,
        slope: float = 0.0,
    ) -> None:  # fmt: skip
        self.c = c
        self.variance = variance
        self.noise = noise
        self.seen = seen
        self.drift = drift
        self.left = left
        self.slope = slope

    def after(self, strokes: float) -> float:
        """The load so many strokes later, if its drift goes on [N s/m]."""
        return self.c + strokes * self.slope


NONE_YET: Final = InferredLoad()


@final
class PredictiveState(Value):
    """The load, shares of the fuel by side, error of the map [m].

    end_m: dead centre that was predicted (0: none); offset_before_m: to undo the last lesson
    calm: strokes since the load was seen to change; none of the first few teaches anything
    """

    __slots__ = (
        "load", "share", "offset_m", "offset_before_m", "end_m", "calm", "known", "noise",
    )  # fmt: skip

    def __init__(
        self, load: InferredLoad = NONE_YET, share: tuple[float, float] = (1.0, 1.0),
        offset_m: float = 0.0, offset_before_m: float = 0.0, end_m: float = 0.0,
        calm: i64 = _CALM, known: bool = True, noise: Noise = NOTHING_SEEN,
    ) -> None:  # fmt: skip
        self.load = load
        self.share = share
        self.offset_m = offset_m
        self.offset_before_m = offset_before_m
        self.end_m = end_m
        self.calm = calm
        self.known = known
        self.noise = noise


@final
class Predictive(Law[PredictiveState]):
    """Called once a stroke."""

    name: ClassVar[str] = "predictive"
    parameters: ClassVar[tuple[str, ...]] = (
        "predictive.drift", "predictive.noise_gain", "predictive.gate",
    )  # fmt: skip
    needs_map: ClassVar[bool] = True

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.quiet = Quiet(config.quiet)
        self.learning = Learning(config.learning, config.quiet)

    def initial(self) -> PredictiveState:
        """No load inferred yet."""
        return PredictiveState()

    def step(self, state: PredictiveState, view: View) -> tuple[PredictiveState, Demand]:
        """Infer, predict, correct: the fuel for the combustion at the end of this stroke."""
        believed, motion, ahead = view.believed, view.motion, view.motion.side_ahead
        if not state.known:
            state = _aligned(self.learning, state, view)
        q = max(_at(state.share, 1 - ahead) * view.burnt_at(1 - ahead), 1e-9)
        v_mid = motion.v_mid_m_s / believed.speed
        noise = state.noise.after(self.quiet, motion.tdc_m - view.tdc_ref_m, motion.side)
        part = noise.share(self.quiet)
        clear = 1.0 if noise.sigma_m < self.quiet.least_m else 0.0
        load, excess, news = _inferred(
            self.config.predictive, state.load, view, q, v_mid, (part, clear)
        )
        share, offset_m, calm = _lessons(
            self.learning, state, motion.tdc_m, 1 - ahead, excess, news, part
        )
        _, tau = believed.pass_mid(q, load.c, motion.tdc_m)
        end_m = believed.travel(q, load.c, 0.0, v_mid, tau)[0] + offset_m
        start_m = end_m
        if view.lag and view.enclosed_kg > 0.0:  # a stroke on what is enclosed comes before
            enclosed = _at(share, ahead) * view.enclosed_kg
            start_m = believed.end_of(enclosed, load.c, end_m) + offset_m
        wanted = believed.charge_for(
            load.after(_NEXT), start_m, view.tdc_ref_m - offset_m, view.point.fuel_kg
        )
        asked = wanted / _at(share, view.fuel_side)
        fuel_kg = view.limited_kg(asked)
        demand = Demand(
            fuel_kg, view.point.v_mid_m_s, inner_p_kg=fuel_kg - view.point.fuel_kg,
            inner_i_kg=asked - wanted,
        )  # fmt: skip
        return PredictiveState(
            load, share, offset_m, state.offset_m, end_m, calm, True, noise
        ), demand

    def taken_over(self, view: View) -> PredictiveState:
        """The shares are still to be aligned with the fuel in force."""
        return PredictiveState(known=False)

    def restarted(self, state: PredictiveState) -> PredictiveState:
        """Keep what was learnt; the stroke under way was not predicted."""
        return replace(state, end_m=0.0, load=replace(state.load, c=0.0, drift=NO_DRIFT, slope=0.0))


def _at(share: tuple[float, float], side: i64) -> float:
    return share[0] if side == 0 else share[1]


def _inferred(
    config: PredictiveConfig,
    before: InferredLoad,
    view: View,
    q: float,
    v_mid: float,
    parts: tuple[float, float],
) -> tuple[InferredLoad, float, float]:
    """The load behind a mid-stroke speed; by how much it exceeds, and what of that is news.

    Parameters: parts : of the gains that act, and of a drift that is foreseen: none amid noise
    """
    believed, commanded = view.believed, view.load_n_s_m
    expected = before.after(1.0)
    seen = believed.load_behind(q, view.motion.tdc_m, v_mid, expected or commanded)
    seen = min(max(seen, _LEAST * commanded), _MOST * commanded)
    excess = seen / (expected or seen) - 1.0
    # Two cylinders that differ alternate: what the same side has shown before is no load step.
    again = seen / before.seen[1] - 1.0 if before.seen[1] > 0.0 else excess
    news = min(abs(excess), abs(again))
    trust = 1.0 if abs(believed.speed - 1.0) < _SAME_SPEED else config.poor_map_trust
    return _filtered(config, before, seen, trust * excess, trust * news, parts), excess, news


def _filtered(
    config: PredictiveConfig,
    before: InferredLoad,
    seen: float,
    excess: float,
    news: float,
    parts: tuple[float, float],
) -> InferredLoad:
    """The load, its variance and the noise of an inference: a Kalman filter, noise learnt.

    What the noise cannot explain is a change of the load, and is taken at once.
    """
    part, clear = parts
    wander = part * config.drift
    variance = before.variance + wander * wander
    square = news * news
    s = variance + before.noise
    if square > config.gate * config.gate * s:
        variance += square * _TRUST
        s = variance + before.noise
    gain = variance / s
    # What a drift leaves over is much the same each time; only what changes is noise.
    apart = excess - before.left
    changed = min(square, 0.5 * apart * apart)
    spread = min(square + clear * (changed - square), _WORST_SHARE * before.noise)
    noise = before.noise + config.noise_gain * (spread - before.noise)
    noise = max(noise, config.noise_floor * config.noise_floor)
    c = (before.after(1.0) or seen) * (1.0 + gain * excess)
    drift = before.drift.after(c)
    return InferredLoad(
        c, variance * (1.0 - gain), noise, (seen, before.seen[0]), drift, excess,
        clear * _confirmed(drift.lasting, before.drift.lasting),
    )  # fmt: skip


def _confirmed(now: float, before: float) -> float:
    """What of a drift has lasted a stroke more: a step between mid-strokes shows in two of them."""
    if now * before <= 0.0:
        return 0.0
    return now if abs(now) < abs(before) else before


def _lessons(
    config: Learning, state: PredictiveState, tdc_m: float, fired: i64, excess: float,
    news: float, part: float,
) -> tuple[tuple[float, float], float, i64]:  # fmt: skip
    """Shares, error of the map and calm after this stroke; a change of the load undoes lessons."""
    offset_m, calm = state.offset_m, min(state.calm + 1, _CALM)
    if state.end_m > 0.0 and state.calm >= _CALM:
        offset_m += part * config.gain * (tdc_m - state.end_m)
        offset_m = min(max(offset_m, -config.offset_m), config.offset_m)
    if news > config.load_change:
        return state.share, state.offset_before_m, 0
    share = _balanced(config, state.share, fired, part * excess) if calm >= _CALM else state.share
    return share, offset_m, calm


def _balanced(
    config: Learning, share: tuple[float, float], fired: i64, excess: float
) -> tuple[float, float]:
    """A load that seems to alternate from stroke to stroke is a charge that does.

    Half of the alternation belongs to each side, with opposite signs; their mean stays.
    """
    less = 0.5 * config.gain * excess
    moved = [s - less if side == fired else s + less for side, s in enumerate(share)]
    left, right = (min(max(s, config.share_min), config.share_max) for s in moved)
    return left, right


def _aligned(config: Learning, state: PredictiveState, view: View) -> PredictiveState:
    """After a change of law: the shares with which this law asks for the fuel in force.

    The load and the charge cannot both be told from a mid-stroke velocity; the commanded load is
    believed, and what remains is the charge.
    """
    if not is_near(config, view):
        return replace(state, known=True)
    left, right = view.burnt_kg
    share = shares_of(config, 0.5 * (left + right), view.burnt_kg)
    return replace(state, share=share, known=True)
