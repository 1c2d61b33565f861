"""Level 2, supervisory: TDC set point, throttle and external load from a target power.

The load for a power comes from what is known of the engine (controller/supervision), corrected by
the power that is measured:  c = c(P_ref, TDC) (1 + I),  I += g (P_ref - P) / P_ref  once a
stroke. Without a target power the configured load holds (thesis section 6.1.3, level 2).
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.knowledge import OperatingPoint
from controller.supervision.air import Air
from controller.supervision.performance import (
    Performance,
    Reach,
    full_load,
    nominal_load,
)
from controller.supervision.target import Target
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.values import Value, replace

LEAST_W: Final = 1.0
"""The error of a smaller target is a share of this."""

NEWEST: Final = 0.2
"""Part of the newest stroke in the average of the power.

A load acts on the dead centres at once, and on the power only once the fuel has followed: without
the average the two loops would excite each other.
"""

WITHIN: Final = 0.02
"""Share of the target by which the power may be off once a limit is no longer told."""

SHORT_STROKES: Final = 4
"""So many strokes in a row on all the fuel there may be, and the load is taken back."""

SHORT_M: Final = 0.1e-3
"""By so much at the least their dead centres fall short."""

_SHORT_STEP: Final = 0.02
"""Share of the load that each further one takes off."""

POWER_LIMITED: Final = "power-limited"
POWER_WITHIN_REACH: Final = "power-within-reach"
LOAD_RATE_LIMITED: Final = "load-rate-limited"

Events = tuple[tuple[str, str], ...]
"""(code, text) of each."""

_NONE: Final[Events] = ()


@final
class SetPoints(Value):
    """What the layers below are asked for.

    tdc_target_m, load_target_n_s_m are where set point and load are moving to; `point` belongs to
    tdc_ref and load.
    manifold_pa: pressure in the intake manifold, as estimated; most_kg: the fuel that it admits, or
    the throttle does
    load_share, fuel_share: what the protection leaves of the load, and of the steady fuel
    """

    __slots__ = (
        "tdc_ref_m", "tdc_target_m", "load_n_s_m", "load_target_n_s_m", "throttle", "point",
        "target", "manifold_pa", "most_kg", "load_share", "fuel_share",
    )  # fmt: skip

    def __init__(
        self, tdc_ref_m: float, tdc_target_m: float, load_n_s_m: float, load_target_n_s_m: float,
        throttle: float, point: OperatingPoint, target: Target | None = None,
        manifold_pa: float = 0.0, most_kg: float = 0.0, load_share: float = 1.0,
        fuel_share: float = 1.0,
    ) -> None:  # fmt: skip
        self.tdc_ref_m = tdc_ref_m
        self.tdc_target_m = tdc_target_m
        self.load_n_s_m = load_n_s_m
        self.load_target_n_s_m = load_target_n_s_m
        self.throttle = throttle
        self.point = point
        self.target = target
        self.manifold_pa = manifold_pa
        self.most_kg = most_kg
        self.load_share = load_share
        self.fuel_share = fuel_share


@final
class Supervisor:
    """The layer for one configuration; what changes is its `SetPoints`.

    Parameters: begun : configuration with which the run began, if that is another one
    """

    def __init__(
        self, config: ControllerConfig, engine: Prototype, period_s: float, limit_m: float,
        begun: ControllerConfig | None = None,
    ) -> None:  # fmt: skip
        section = config.supervisory
        self._limit_m = limit_m
        self._tdc_step_m = section.tdc_step_m
        self.performance = Performance(config, engine, period_s, begun)
        self.air = Air(config, engine)
        self.full_load_n_s_m = full_load(config, engine)
        self.nominal_load_n_s_m = nominal_load(config, engine)
        self._target_w = section.target_power_w
        self._throttle = section.throttle
        self._slew_n_s_m_s = section.load_slew_n_s_m_per_s
        self._gain = section.power_gain
        self._trim_most = section.trim_most
        self._chooses = section.choice == "efficiency"

    def initial(self) -> SetPoints:
        """Set points at the start of the run."""
        known = self.performance
        tdc_m, load, target_w = known.tdc_m, known.load_n_s_m, self._target_w
        throttle = self._throttle
        if target_w is not None and self._chooses:
            throttle = known.best(target_w)[1]
        point = known.point(tdc_m, load)
        throttle = self.air.throttle_for(point.fuel_kg, throttle)
        p_pa = throttle * self.air.full_pa
        most_kg = self.air.most_kg(throttle, p_pa)
        now = SetPoints(tdc_m, tdc_m, load, load, throttle, point, None, p_pa, most_kg)
        if target_w is None:
            return now
        return self._aimed(now, target_w, known.at_start(target_w, throttle))

    def changed(
        self, now: SetPoints, tdc_ref_m: float | None, power_w: float | None
    ) -> tuple[SetPoints, Events]:
        """Take new set points from the operator; a target power is kept at another dead centre."""
        tdc, throttle = now.tdc_target_m, now.throttle
        if tdc_ref_m is not None:
            tdc = tdc_ref_m
        elif power_w is not None and self._chooses:
            tdc, throttle = self.performance.best(power_w)
        after = self.approach(self.throttled(replace(now, tdc_target_m=tdc), throttle, 0.0))
        if power_w is None and now.target is not None:
            power_w = now.target.asked_w
        if power_w is None:
            return after, _NONE
        reach = self.performance.reach(tdc, power_w, throttle)
        after, events = _told(self._aimed(after, power_w, reach))
        gap = abs(after.load_target_n_s_m - after.load_n_s_m)
        if gap > self._slew_n_s_m_s * after.point.stroke_s:
            text = f"load {after.load_n_s_m:.1f} to {after.load_target_n_s_m:.1f} N s/m takes "
            text = (
                f"{text}{gap / self._slew_n_s_m_s:.3f} s at {self._slew_n_s_m_s:g} N s/m a second"
            )
            events = (*events, (LOAD_RATE_LIMITED, text))
        return after, events

    def released(self, now: SetPoints) -> SetPoints:
        """Let go of a target power: the configured load holds."""
        return replace(now, target=None, load_target_n_s_m=self.nominal_load_n_s_m)

    def _aimed(self, now: SetPoints, asked_w: float, reach: Reach) -> SetPoints:
        """Aim at a power, as far as the engine reaches; what was learnt of its load stays."""
        load, within_w = reach.load_n_s_m, asked_w
        if reach.limit:
            within_w = self.performance.steady(now.tdc_target_m, load).power_w
        before = now.target
        target = Target(asked_w, within_w, load, limit=reach.limit)
        if before is not None:
            target = replace(
                before, asked_w=asked_w, within_w=within_w, base_n_s_m=load, limit=reach.limit,
                held="",
            )  # fmt: skip
        return replace(now, target=target, load_target_n_s_m=target.load_n_s_m)

    def approach(self, now: SetPoints) -> SetPoints:
        """Move the TDC set point towards its target by what one stroke allows.

        That is `tdc_step_m`, and towards the head half of the room that is left: an overshoot as
        large as the step itself stays inside the position limit.
        """
        if now.tdc_ref_m == now.tdc_target_m:
            return now
        step_m = self._tdc_step_m
        most = now.tdc_ref_m + min(step_m, max(0.5 * (self._limit_m - now.tdc_ref_m), 0.0))
        tdc_m = max(min(now.tdc_target_m, most), now.tdc_ref_m - step_m)
        point = self.performance.point(tdc_m, now.load_n_s_m)
        now = replace(now, tdc_ref_m=tdc_m, point=point)
        return self.throttled(now, self.air.throttle_for(point.fuel_kg, now.throttle), 0.0)

    def slew(self, now: SetPoints, dt: float) -> SetPoints:
        """Move the load towards its target by what one tick allows, the air after the throttle."""
        if now.manifold_pa != now.throttle * self.air.full_pa:
            now = self.throttled(now, now.throttle, dt)
        load = now.load_target_n_s_m * now.load_share
        if now.load_n_s_m == load:
            return now
        most, gap = self._slew_n_s_m_s * dt, load - now.load_n_s_m
        if abs(gap) > most:
            load = now.load_n_s_m + (most if gap > 0 else -most)
        point = self.performance.point(now.tdc_ref_m, load)
        now = replace(now, load_n_s_m=load, point=point)
        return self.throttled(now, self.air.throttle_for(point.fuel_kg, now.throttle), 0.0)

    def throttled(self, now: SetPoints, throttle: float, dt: float) -> SetPoints:
        """Set the throttle, let the manifold follow it for a time, and see what fuel it admits."""
        p_pa = self.air.followed_pa(now.manifold_pa, throttle, dt)
        if not self.air.limits:
            p_pa = throttle * self.air.full_pa
        most_kg = self.air.most_kg(throttle, p_pa)
        if now.fuel_share < 1.0:
            most_kg = min(most_kg, now.point.fuel_kg * now.fuel_share)
        return replace(now, throttle=throttle, manifold_pa=p_pa, most_kg=most_kg)

    def derated(self, now: SetPoints, load_share: float, fuel_share: float) -> SetPoints:
        """Leave a share of the load, and no more than a share of the steady fuel."""
        if load_share == now.load_share and fuel_share == now.fuel_share:
            return now
        now = replace(now, load_share=load_share, fuel_share=fuel_share)
        return self.throttled(now, now.throttle, 0.0)

    def regulated(
        self, now: SetPoints, power_w: float | None, is_short: bool
    ) -> tuple[SetPoints, Events]:
        """Correct the load by the mean power of a stroke.

        Parameters: power_w : None when it is not known; is_short : all the fuel that there may be
        did not bring the piston to its set point
        """
        target = now.target
        if target is None or power_w is None:
            return now, _NONE
        if target.power_w is not None:
            power_w = target.power_w + NEWEST * (power_w - target.power_w)
        if now.load_n_s_m != now.load_target_n_s_m:  # still on its way to what was asked for
            return replace(now, target=replace(target, power_w=power_w)), _NONE
        target = self._corrected(target, power_w, is_short)
        return _told(replace(now, target=target, load_target_n_s_m=target.load_n_s_m))

    def _corrected(self, target: Target, power_w: float, is_short: bool) -> Target:
        """Move the correction by a part of the error, within its limit.

        A stroke that lacks fuel asks for no more load, and several of them for less.
        """
        error = (target.within_w - power_w) / max(target.within_w, LEAST_W)
        short: i64 = target.short + 1 if is_short else 0
        step = self._gain * (min(error, 0.0) if is_short else error)
        held, most = "", self._trim_most
        if short >= SHORT_STROKES:
            step -= _SHORT_STEP
            held = "the fuel that there may be does not hold the dead centre"
        trim = min(max(target.trim + step, -most), most)
        if abs(trim) == most and abs(error) > WITHIN:
            held = f"supervisory.trim_most, {most:g}, at {power_w:.0f} W"
        if abs(error) > WITHIN:
            held = target.held or held  # until the power is there again
        return Target(
            target.asked_w, target.within_w, target.base_n_s_m, trim, target.limit, held,
            target.told, short, power_w,
        )  # fmt: skip


def _told(now: SetPoints) -> tuple[SetPoints, Events]:
    """Tell of a limit that was not told yet, or that it has gone."""
    target = now.target
    if target is None or target.in_the_way == target.told:
        return now, _NONE
    code, text, why = POWER_WITHIN_REACH, f"{target.asked_w:g} W are within reach", ""
    if target.in_the_way:
        code, why = POWER_LIMITED, target.in_the_way
        text = f"{target.asked_w:g} W asked, {target.within_w:.0f} W within reach: {why}"
    return replace(now, target=replace(target, told=why)), ((code, text),)
