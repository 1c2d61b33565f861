"""Configuration of the controller process, one section a layer."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hil.config.base import Section

ControllerName = Literal["cascade", "single-loop", "open-loop"]

Metres = Annotated[float, Field(gt=0.0, le=0.05)]
FuelKg = Annotated[float, Field(ge=0.0, le=6.0e-6)]


class Gains(Section):
    """Gains of one PI loop; the integral gain acts once a stroke."""

    kp: float = Field(ge=-1e3, le=1e3)
    ki: float = Field(ge=-1e3, le=1e3)


class CascadeConfig(Section):
    """Outer loop on the previous stroke's TDC, inner loop on this stroke's mid-stroke velocity.

    outer: m/s of velocity reference per m of TDC error
    inner: kg of fuel per m/s of velocity error
    Found by `python -m bench.tune cascade`; objective and result are in docs/tuning.md.
    """

    outer: Gains = Gains(kp=39.0, ki=52.0)
    inner: Gains = Gains(kp=3.12e-6, ki=2.06e-6)
    v_correction_max_m_s: float = Field(default=1.0, gt=0.0, le=5.0)


class SingleLoopConfig(Section):
    """One PI from TDC error to fuel, with the delay of the thesis's Table 6.2 (kg per m)."""

    tdc: Gains = Gains(kp=1.8105e-4, ki=1.016e-4)


class OpenLoopConfig(Section):
    """Fixed fuel; None takes the model's own default."""

    fuel_kg: FuelKg | None = None


class StartConfig(Section):
    """Starting by motoring in resonance (thesis section 6.1.3, level 1).

    force_n: limit of the motoring force
    amplitude_ratio: amplitude that motoring aims at, as a share of the TDC set point
    ignition_ratio: amplitude from which a stroke may be fired, likewise
    open_strokes: fired strokes on the steady fuel before the law takes over
    """

    force_n: float = Field(default=110.0, gt=0.0, le=4000.0)
    amplitude_ratio: float = Field(default=0.90, gt=0.1, le=1.1)
    ignition_ratio: float = Field(default=0.80, gt=0.1, le=1.1)
    open_strokes: int = Field(default=3, ge=1, le=100)
    timeout_s: float = Field(default=5.0, gt=0.0, le=60.0)


class SupervisoryConfig(Section):
    """Set points from a target power (level 2); without a target the fixed values hold."""

    target_power_w: float | None = Field(default=None, ge=0.0, le=10_000.0)
    load_coefficient_n_s_m: float | None = Field(default=None, ge=0.0, le=5000.0)
    load_slew_n_s_m_per_s: float = Field(default=2000.0, gt=0.0, le=1e6)
    throttle: float = Field(default=1.0, gt=0.0, le=1.0)


class TimingConfig(Section):
    """When edges are placed (level 4)."""

    spark_advance_s: float = Field(default=1.5e-3, ge=0.2e-3, le=2.8e-3)
    spark_duration_s: float = Field(default=0.5e-3, ge=0.01e-3, le=2.0e-3)
    spark_ahead_s: float = Field(default=10.0e-3, ge=1.0e-3, le=20.0e-3)
    injection_lead_ticks: int = Field(default=3, ge=1, le=20)
    injection_margin_s: float = Field(default=1.0e-3, ge=0.0, le=5.0e-3)


class InjectorKnowledge(Section):
    """What the controller believes of the injectors."""

    static_flow_kg_s: float = Field(default=1.0e-3, gt=0.0, le=0.1)
    dead_time_s: float = Field(default=0.8e-3, ge=0.0, le=5e-3)


class LimitsConfig(Section):
    """The last limit: beyond it the controller goes to its safe state."""

    tdc_m: Metres | None = None
    fuel_min_kg: FuelKg = 0.2e-6
    fuel_max_kg: FuelKg = 6.0e-6
    force_n: float = Field(default=4000.0, gt=0.0, le=5000.0)
    stale_ticks: int = Field(default=10, ge=2, le=1000)
    misfires: int = Field(default=3, ge=1, le=1000)


class Preset(Section):
    """The operating point about which the laws work; the bench computes it from the model."""

    fuel_kg: FuelKg | None = None
    v_mid_m_s: float | None = Field(default=None, gt=0.0, le=8.0)
    stroke_s: float | None = Field(default=None, gt=0.0, le=1.0)
    fuel_per_speed_kg_s_m: float | None = Field(default=None, gt=0.0, le=1.0e-3)


class ControllerConfig(Section):
    """Everything that the controller process is told."""

    name: ControllerName = "cascade"
    tdc_ref_m: Metres | None = None
    running: bool = Field(default=True, description="begins with the engine already running")
    cascade: CascadeConfig = CascadeConfig()
    single_loop: SingleLoopConfig = SingleLoopConfig()
    open_loop: OpenLoopConfig = OpenLoopConfig()
    start: StartConfig = StartConfig()
    supervisory: SupervisoryConfig = SupervisoryConfig()
    timing: TimingConfig = TimingConfig()
    injector: InjectorKnowledge = InjectorKnowledge()
    limits: LimitsConfig = LimitsConfig()
    preset: Preset = Preset()
