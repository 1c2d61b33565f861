"""Level 2, supervisory: TDC set point, throttle and external load from a target power.

Without a target power the configured load holds (thesis section 6.1.3, level 2).
"""

from __future__ import annotations

from typing import final

from controller.knowledge import OperatingPoint, load_for_power, operating_point
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.values import Value, replace


@final
class SetPoints(Value):
    """What the layers below are asked for.

    tdc_target_m, load_target_n_s_m are where set point and load are moving to; `point` belongs to
    tdc_ref and load.
    """

    __slots__ = (
        "tdc_ref_m", "tdc_target_m", "load_n_s_m", "load_target_n_s_m", "throttle", "point",
    )  # fmt: skip

    def __init__(
        self, tdc_ref_m: float, tdc_target_m: float, load_n_s_m: float, load_target_n_s_m: float,
        throttle: float, point: OperatingPoint,
    ) -> None:  # fmt: skip
        self.tdc_ref_m = tdc_ref_m
        self.tdc_target_m = tdc_target_m
        self.load_n_s_m = load_n_s_m
        self.load_target_n_s_m = load_target_n_s_m
        self.throttle = throttle
        self.point = point


def initial(config: ControllerConfig, engine: Prototype) -> SetPoints:
    """Set points at the start of the run."""
    tdc = config.tdc_ref_m or engine.tdc_ref_m
    load = target_load(config, engine, tdc, config.supervisory.target_power_w)
    point = with_preset(config, engine, tdc, load)
    return SetPoints(tdc, tdc, load, load, config.supervisory.throttle, point)


def nominal_load(config: ControllerConfig, engine: Prototype) -> float:
    """Load coefficient without a target power [N s/m]."""
    configured = config.supervisory.load_coefficient_n_s_m
    return engine.load_coefficient_n_s_m if configured is None else configured


def target_load(
    config: ControllerConfig, engine: Prototype, tdc_m: float, power_w: float | None
) -> float:
    """Load coefficient for a target power, within what the machine can do [N s/m]."""
    if power_w is None:
        return nominal_load(config, engine)
    return min(load_for_power(engine, tdc_m, power_w), full_load(config, engine))


def full_load(config: ControllerConfig, engine: Prototype) -> float:
    """Load coefficient of the safe state: the machine brakes as hard as in nominal use [N s/m]."""
    return max(nominal_load(config, engine), engine.load_coefficient_n_s_m)


def with_preset(
    config: ControllerConfig, engine: Prototype, tdc_m: float, load_n_s_m: float
) -> OperatingPoint:
    """Operating point of the closed form, scaled so that it meets the preset at the start.

    The bench presets the steady state of the plant's own model; from there the closed form says
    how it moves with set point and load.
    """
    preset = config.preset
    start_tdc = config.tdc_ref_m or engine.tdc_ref_m
    start_load = target_load(config, engine, start_tdc, config.supervisory.target_power_w)
    start = operating_point(engine, start_tdc, start_load)
    here = operating_point(engine, tdc_m, load_n_s_m)
    fuel, v_mid, stroke = preset.fuel_kg, preset.v_mid_m_s, preset.stroke_s
    slope = preset.fuel_per_speed_kg_s_m
    return OperatingPoint(
        here.fuel_kg if fuel is None else fuel * _ratio(here.fuel_kg, start.fuel_kg),
        here.v_mid_m_s if v_mid is None else v_mid * here.v_mid_m_s / start.v_mid_m_s,
        here.stroke_s if stroke is None else stroke * here.stroke_s / start.stroke_s,
        here.fuel_per_speed_kg_s_m if slope is None else slope,
    )


def _ratio(here: float, start: float) -> float:
    """Quotient of two fuels; both are zero without a load."""
    return here / start if start > 0.0 else 1.0


def change(
    config: ControllerConfig,
    engine: Prototype,
    now: SetPoints,
    tdc_m: float | None,
    power_w: float | None,
    limit_m: float,
) -> SetPoints:
    """Take new set points from the operator; TDC and load move to their new targets."""
    target_m = now.tdc_target_m if tdc_m is None else tdc_m
    load = now.load_target_n_s_m
    if power_w is not None:
        load = target_load(config, engine, target_m, power_w)
    targets = replace(now, tdc_target_m=target_m, load_target_n_s_m=load)
    return approach(config, engine, targets, limit_m)


def approach(
    config: ControllerConfig, engine: Prototype, now: SetPoints, limit_m: float
) -> SetPoints:
    """Move the TDC set point towards its target by what one stroke allows.

    That is `tdc_step_m`, and towards the head half of the room that is left: an overshoot as large
    as the step itself stays inside the position limit `limit_m`.
    """
    if now.tdc_ref_m == now.tdc_target_m:
        return now
    step_m = config.supervisory.tdc_step_m
    most = now.tdc_ref_m + min(step_m, max(0.5 * (limit_m - now.tdc_ref_m), 0.0))
    tdc_m = max(min(now.tdc_target_m, most), now.tdc_ref_m - step_m)
    point = with_preset(config, engine, tdc_m, now.load_n_s_m)
    return replace(now, tdc_ref_m=tdc_m, point=point)


def slew(config: ControllerConfig, engine: Prototype, now: SetPoints, dt: float) -> SetPoints:
    """Move the load towards its target by what one tick allows."""
    if now.load_n_s_m == now.load_target_n_s_m:
        return now
    most = config.supervisory.load_slew_n_s_m_per_s * dt
    gap = now.load_target_n_s_m - now.load_n_s_m
    load = (
        now.load_target_n_s_m if abs(gap) <= most else now.load_n_s_m + (most if gap > 0 else -most)
    )
    return replace(now, load_n_s_m=load, point=with_preset(config, engine, now.tdc_ref_m, load))
