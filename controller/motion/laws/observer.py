"""Extended state observer: velocity, load and charge from position and velocity alone.

m v' = q f [(1 - h) + h (4/pi) sin(omega tau)] - (k0 + k_q q) z - c v,  c' = 0,  q' = 0

a Kalman filter of three states, exact in v between two samples because z is measured. The charge
is drawn anew at each dead centre, where v is nought; the load drifts, and jumps where nothing
else explains what is seen (after the controllers of FPEC and the later literature, thesis
chapter 2). The fuel is deadbeat, and trimmed until it has flowed.
"""

from __future__ import annotations

from typing import ClassVar, Final, final

from mypy_extensions import i64

from controller.motion.charge import (
    AS_BELIEVED,
    NOTHING_FORESEEN,
    UNALIGNED,
    Charge,
    Forecast,
    Learning,
    first_fuel,
    is_near,
)
from controller.motion.deadbeat import at_dead_centre, fuel_after
from controller.motion.law import NO_TRIM, Demand, Law, Trim, View
from controller.motion.maps.stroke_map import StrokeMap
from controller.observe.estimate import SHOWN_NS, Motion
from hil.config.controller import ControllerConfig
from hil.config.motion.laws import ObserverConfig
from hil.values import Value, replace

_LEAST: Final = 0.2
_MOST: Final = 4.0
_WORST_SHARE: Final = 9.0
_END_MOVED_M: Final = 20e-6
_SHOWN_TICKS: Final = 1.5
"""Over more than this the momentum is not told by the two positions."""
_SHOWN_S: Final = SHOWN_NS * 1e-9


@final
class Covariance(Value):
    """Of velocity, load and charge: [m2/s2, (N s/m)2, kg2] and their products."""

    __slots__ = ("vv", "vc", "vq", "cc", "cq", "qq")

    def __init__(
        self, vv: float = 0.0, vc: float = 0.0, vq: float = 0.0, cc: float = 400.0,
        cq: float = 0.0, qq: float = 0.0,
    ) -> None:  # fmt: skip
        self.vv = vv
        self.vc = vc
        self.vq = vq
        self.cc = cc
        self.cq = cq
        self.qq = qq


_WIDE: Final = Covariance()
_TAKEN_OVER: Final = Covariance(cc=100.0)


@final
class Estimate(Value):
    """Velocity, load and charge with their covariance; z of the sample before; noise of v."""

    __slots__ = ("v", "c", "q", "p", "z", "noise_m2_s2")

    def __init__(
        self, v: float = 0.0, c: float = 0.0, q: float = 0.0, p: Covariance = _WIDE,
        z: float = 0.0, noise_m2_s2: float = 1e-6,
    ) -> None:  # fmt: skip
        self.v = v
        self.c = c
        self.q = q
        self.p = p
        self.z = z
        self.noise_m2_s2 = noise_m2_s2


_NOTHING_KNOWN: Final = Estimate()


@final
class ObserverState(Value):
    """The estimate, what was learnt, what is foreseen, and what the fuel was set for.

    begun: whether this stroke has been followed from its dead centre on
    seen_ns: the sample that the estimate has followed last
    """

    __slots__ = (
        "estimate", "begun", "charge", "forecast", "fuel_for_n_s_m", "fuel_for_m", "seen_ns",
    )  # fmt: skip

    def __init__(
        self, estimate: Estimate = _NOTHING_KNOWN, begun: bool = False,
        charge: Charge = AS_BELIEVED, forecast: Forecast = NOTHING_FORESEEN,
        fuel_for_n_s_m: float = 0.0, fuel_for_m: float = 0.0, seen_ns: i64 = -1,
    ) -> None:  # fmt: skip
        self.estimate = estimate
        self.begun = begun
        self.charge = charge
        self.forecast = forecast
        self.fuel_for_n_s_m = fuel_for_n_s_m
        self.fuel_for_m = fuel_for_m
        self.seen_ns = seen_ns


@final
class Filter:
    """Section `observer` of the configuration, read once for all ticks."""

    def __init__(self, config: ObserverConfig) -> None:
        self.drift_n_s_m = config.drift_n_s_m
        self.drift_m_s = config.drift_m_s
        self.slowest_m_s = config.slowest_m_s
        self.charge_spread = config.charge_spread
        self.load_jump = config.load_jump
        self.gate = config.gate
        self.step_min_m_s = config.step_min_m_s
        self.noise_floor_m_s = config.noise_floor_m_s
        self.noise_gain = config.noise_gain


@final
class Observer(Law[ObserverState]):
    """The filter, and the fuel that follows from it, in every tick."""

    name: ClassVar[str] = "observer"
    parameters: ClassVar[tuple[str, ...]] = (
        "observer.drift_n_s_m", "observer.charge_spread", "observer.load_jump", "observer.gate",
    )  # fmt: skip
    needs_map: ClassVar[bool] = True
    needs_force: ClassVar[bool] = True

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.learning = Learning(config.learning, config.quiet)
        self.filter = Filter(config.observer)
        self.retrim = config.load_estimate.retrim

    def initial(self) -> ObserverState:
        """Nothing known of the load, the charge as commanded."""
        return ObserverState()

    def step(self, state: ObserverState, view: View) -> tuple[ObserverState, Demand]:
        """The steady fuel, until the watch trims it in the same tick."""
        demand = Demand(first_fuel(state.charge, view), view.point.v_mid_m_s)
        after = ObserverState(
            state.estimate, state.begun, state.charge, state.forecast, 0.0, state.fuel_for_m,
            state.seen_ns,
        )  # fmt: skip
        return after, demand

    def watch(
        self, state: ObserverState, view: View, planned_kg: float
    ) -> tuple[ObserverState, Trim]:
        """Follow the motion by one tick; at the dead centre begin anew; trim the fuel."""
        if view.passed.dead_centre:
            return self._begin(state, view), NO_TRIM
        if not state.begun:
            return state, NO_TRIM
        motion, learnt, load = view.motion, state.charge, view.load_n_s_m
        believed = learnt.map_of(view)
        if float(motion.t_ns - state.seen_ns) * 1e-9 > _SHOWN_TICKS * view.dt_s:
            now = resumed(state.estimate, motion)
        else:
            now = follow(
                self.filter, believed, state.estimate, motion.z_m, motion.speed_m_s, motion.tau_s,
                view.dt_s,
            )  # fmt: skip
        if not _LEAST * load < now.c < _MOST * load:
            now = replace(now, c=load, p=Covariance(qq=now.p.qq))
        fuel_for_c, fuel_for_m, trim = state.fuel_for_n_s_m, state.fuel_for_m, NO_TRIM
        if planned_kg != 0.0 and learnt.known:
            end_m, _ = believed.travel(now.q, now.c, motion.z_m, now.v, motion.tau_s)
            same_load = abs(now.c - fuel_for_c) <= self.retrim * now.c
            if not same_load or abs(end_m - fuel_for_m) > _END_MOVED_M:
                fuel_for_c, fuel_for_m = now.c, end_m
                trim = Trim(fuel_after(view, learnt, now.c, end_m, planned_kg))
        after = ObserverState(
            now, True, learnt, state.forecast, fuel_for_c, fuel_for_m, motion.t_ns
        )
        return after, trim

    def _begin(self, state: ObserverState, view: View) -> ObserverState:
        """At a dead centre: v was nought there, the charge is what was asked for, about."""
        motion = view.motion
        if not state.charge.known:
            state = _aligned(self.learning, state, view)
        before = state.estimate
        c = before.c or view.load_n_s_m
        learnt, forecast = at_dead_centre(
            self.learning, state.charge, state.forecast, view, c, state.fuel_for_m
        )
        q = learnt.effective_kg(view, motion.side)
        spread = self.filter.charge_spread * q
        p = Covariance(cc=before.p.cc, qq=spread * spread)
        begun = Estimate(0.0, c, q, p, -motion.tdc_m, before.noise_m2_s2)
        if motion.tau_s > max(_SHOWN_TICKS * view.dt_s, _SHOWN_S):
            now = resumed(begun, motion)
        else:
            now = follow(
                self.filter, learnt.map_of(view), begun, motion.z_m, motion.speed_m_s, motion.tau_s,
                motion.tau_s,
            )  # fmt: skip
        return ObserverState(now, True, learnt, forecast, seen_ns=motion.t_ns)

    def load_of(self, state: ObserverState, load_n_s_m: float) -> float:
        """The one observed."""
        return state.estimate.c or load_n_s_m

    def taken_over(self, view: View) -> ObserverState:
        """It knows little of the load, and aligns the shares with the fuel in force."""
        return ObserverState(Estimate(p=_TAKEN_OVER), charge=UNALIGNED)

    def restarted(self, state: ObserverState) -> ObserverState:
        """Keep what was learnt, but no load: the stroke without a charge has spoilt it."""
        noise = state.estimate.noise_m2_s2
        return ObserverState(Estimate(noise_m2_s2=noise), False, state.charge)


def _aligned(learning: Learning, state: ObserverState, view: View) -> ObserverState:
    """After a change of law: the load under which the fuel in force holds the set point.

    Load and charge cannot both be told from a steady state; the charge is believed.
    """
    known = replace(state.charge, known=True)
    if not is_near(learning, view):
        return replace(state, charge=known)
    left, right = view.burnt_kg
    mean = 0.5 * (left + right)
    c = view.believed.load_of_cycle(mean, view.tdc_ref_m, view.load_n_s_m)
    known = replace(known, share=(mean / left, mean / right))
    return replace(state, estimate=replace(state.estimate, c=c), charge=known)


def resumed(now: Estimate, motion: Motion) -> Estimate:
    """The estimate behind a gap in the samples: the velocity as it is measured, all else kept."""
    p = Covariance(vv=now.noise_m2_s2, cc=now.p.cc, cq=now.p.cq, qq=now.p.qq)
    return Estimate(motion.speed_m_s, now.c, now.q, p, motion.z_m, now.noise_m2_s2)


def follow(
    config: Filter, believed: StrokeMap, now: Estimate, z: float, v: float, tau: float,
    dt: float,
) -> Estimate:  # fmt: skip
    """One tick of the filter: predict over dt up to tau, correct by the velocity measured."""
    if dt <= 0.0:
        return replace(now, z=z)
    now_to = believed.predict(now.q, now.c, dt, now.z, now.v, z, v, tau)
    predicted, a = now_to.v_m_s, now_to.by_load
    e = v - predicted
    p = _carried(now.p, a, now_to.by_charge, config)
    seen = abs(e) > config.step_min_m_s and abs(v) > config.slowest_m_s
    if seen and e * e > config.gate * config.gate * (p.vv + now.noise_m2_s2):
        p = _after_jump(p, a, config.load_jump * now.c)
    return _corrected(config, now, p, predicted, e, z)


def _corrected(
    config: Filter, now: Estimate, p: Covariance, predicted: float, e: float, z: float
) -> Estimate:
    """The estimate after an innovation e of the velocity."""
    noise = now.noise_m2_s2
    s = p.vv + noise
    spread = min(e * e, _WORST_SHARE * noise)
    floor = config.noise_floor_m_s * config.noise_floor_m_s
    gv, gc, gq = p.vv / s, p.vc / s, p.vq / s
    return Estimate(
        v=predicted + gv * e,
        c=max(now.c + gc * e, 1.0),
        q=max(now.q + gq * e, 1e-9),
        p=Covariance(
            p.vv - gv * p.vv, p.vc - gv * p.vc, p.vq - gv * p.vq,
            p.cc - gc * p.vc, p.cq - gc * p.vq, p.qq - gq * p.vq,
        ),
        z=z,
        noise_m2_s2=max(noise + config.noise_gain * (spread - noise), floor),
    )  # fmt: skip


def _carried(p: Covariance, a: float, b: float, config: Filter) -> Covariance:
    """The covariance a tick later: v takes up a times the load's error and b times the charge's."""
    vv = p.vv + (2.0 * (a * p.vc + b * p.vq) + a * a * p.cc + 2.0 * a * b * p.cq + b * b * p.qq)
    vv += config.drift_m_s * config.drift_m_s
    cc = p.cc + config.drift_n_s_m * config.drift_n_s_m
    return Covariance(vv, p.vc + a * p.cc + b * p.cq, p.vq + a * p.cq + b * p.qq, cc, p.cq, p.qq)


def _after_jump(p: Covariance, a: float, jump: float) -> Covariance:
    """The covariance when the load may have moved by so much."""
    square = jump * jump
    return Covariance(
        p.vv + a * a * jump * jump, p.vc + a * jump * jump, p.vq, p.cc + square, p.cq, p.qq
    )
