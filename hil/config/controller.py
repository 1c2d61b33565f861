"""Configuration of the controller process, one section a layer."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field, model_validator

from hil.brought import SUFFIX, name_of
from hil.config.base import LIVE, Section, Tunable
from hil.config.charge.injection import InjectorKnowledge
from hil.config.motion.cycle import CycleConfig
from hil.config.motion.laws import (
    LearningConfig,
    LoadEstimateConfig,
    MachineLawConfig,
    ObserverConfig,
    OwnLawConfig,
    PdfConfig,
    PredictiveConfig,
    QuietConfig,
)
from hil.config.motion.stroke_map import StrokeMapConfig
from hil.config.prototypes import DEFAULT
from hil.config.ranges import STALE_S, CommandedLoad, StaleS, StartForceN, TdcRefM
from hil.config.supervisory.air import AirKnowledge
from hil.config.supervisory.protection import ProtectionConfig
from hil.config.supervisory.section import SupervisoryConfig
from hil.config.timing import (
    Metres,
    StrokeTime,
    TimingConfig,
    ValvesKnowledge,
)
from hil.wire.commands import LAW
from hil.wire.fields import most_of
from hil.wire.messages import MachineCommand

LawName = Annotated[str, Field(pattern=LAW.pattern)]
"""Of a piston-motion law; which there are is known where a controller is built."""

_WIRE_FORCE_N = most_of(MachineCommand, "force_n")
FuelKg = Annotated[float, Field(ge=0.0, le=1.0e-4)]
MidSpeed = Annotated[float, Field(gt=0.0, le=8.0)]


class Gains(Tunable):
    """Gains of one PID loop (thesis eqs. 6.3, 6.4), which acts once a stroke.

    The thesis found little in a derivative term and leaves it out; so does the cascade here.
    """

    kp: float = Field(ge=-1e3, le=1e3)
    ki: float = Field(ge=-1e3, le=1e3)
    kd: float = Field(default=0.0, ge=-1e3, le=1e3)


class OuterGains(Gains):
    """TDC error [m] to velocity reference [m/s]."""

    unit: ClassVar[str] = "1/s"
    kp: float = Field(default=39.0, ge=-1e3, le=1e3)
    ki: float = Field(default=52.0, ge=-1e3, le=1e3)


class InnerGains(Gains):
    """Velocity error [m/s] to fuel [kg]."""

    unit: ClassVar[str] = "kg s/m"
    kp: float = Field(default=3.12e-6, ge=-1e3, le=1e3)
    ki: float = Field(default=2.06e-6, ge=-1e3, le=1e3)


class TdcGains(Gains):
    """TDC error [m] to fuel [kg]."""

    unit: ClassVar[str] = "kg/m"
    kp: float = Field(default=1.82e-4, ge=-1e3, le=1e3)
    ki: float = Field(default=1.37e-4, ge=-1e3, le=1e3)
    kd: float = Field(default=4.0e-5, ge=-1e3, le=1e3)


class CascadeConfig(Tunable):
    """Outer loop on the previous stroke's TDC, inner loop on this stroke's mid-stroke velocity.

    outer: m/s of velocity reference per m of TDC error
    inner: kg of fuel per m/s of velocity error
    Found by `hil tune cascade --search`; objective and result are in docs/tuning.md.
    """

    outer: OuterGains = OuterGains()
    inner: InnerGains = InnerGains()
    v_correction_max_m_s: float = Field(default=1.0, gt=0.0, le=5.0)


class SingleLoopConfig(Tunable):
    """One PID from TDC error to fuel, with the delay of the thesis's Table 6.2 (kg per m)."""

    tdc: TdcGains = TdcGains()


class OpenLoopConfig(Tunable):
    """Fixed fuel; None takes the model's own default."""

    fuel_kg: FuelKg | None = None


class StartConfig(Tunable):
    """Starting by motoring in resonance (thesis section 6.1.3, level 1).

    force_n: limit of the motoring force
    constant_force: that force throughout (App. I eq. 24), whatever the air springs would need
    amplitude_ratio: amplitude that motoring aims at, as a share of the TDC set point
    ignition_ratio: amplitude from which a stroke may be fired, likewise
    open_strokes: fired strokes on the steady fuel before the law takes over
    """

    force_n: StartForceN = DEFAULT.start_force_n
    constant_force: bool = False
    amplitude_ratio: float = Field(default=0.90, gt=0.1, le=1.1)
    ignition_ratio: float = Field(default=0.80, gt=0.1, le=1.1)
    open_strokes: int = Field(default=3, ge=1, le=100)
    timeout_s: float = Field(default=5.0, gt=0.0, le=60.0)


class LimitsConfig(Tunable):
    """The last limit: beyond it the controller goes to its safe state."""

    tdc_m: Metres | None = None
    fuel_min_kg: FuelKg = DEFAULT.fuel_min_kg
    fuel_max_kg: FuelKg = DEFAULT.fuel_max_kg
    force_n: float = Field(default=DEFAULT.peak_force_n, gt=0.0, le=_WIRE_FORCE_N)
    stale_s: StaleS = Field(default=STALE_S, description="silence borne of the plant")
    misfires: int = Field(default=3, ge=1, le=1000)


class Preset(Section):
    """The operating point about which the laws work; the bench computes it from the model.

    load_coefficient_n_s_m: its load, where a target power asks for another than the supervisory's
    limit: what keeps it from the target power, if something does
    """

    fuel_kg: FuelKg | None = None
    v_mid_m_s: MidSpeed | None = None
    stroke_s: StrokeTime | None = None
    fuel_per_speed_kg_s_m: float | None = Field(default=None, gt=0.0, le=1.0e-3)
    load_coefficient_n_s_m: CommandedLoad | None = None
    power_w: float | None = Field(default=None, ge=-1.0e5, le=1.0e5)
    limit: str = Field(default="", max_length=120)


class Tuning(Section):
    """Where the gains of a law come from; for people, nothing acts on it."""

    law: LawName
    objective: str
    cells: tuple[str, ...] = ()
    method: str = ""
    cost: float
    cost_before: float


class ControllerConfig(Section):
    """Everything that the controller process is told."""

    name: LawName = Field(default="cascade", json_schema_extra=LIVE)
    tdc_ref_m: TdcRefM | None = Field(default=None, json_schema_extra=LIVE)
    running: bool = Field(default=True, description="begins with the engine already running")
    cascade: CascadeConfig = CascadeConfig()
    single_loop: SingleLoopConfig = SingleLoopConfig()
    open_loop: OpenLoopConfig = OpenLoopConfig()
    pdf: PdfConfig = PdfConfig()
    predictive: PredictiveConfig = PredictiveConfig()
    observer: ObserverConfig = ObserverConfig()
    machine: MachineLawConfig = MachineLawConfig()
    stroke_map: StrokeMapConfig = StrokeMapConfig()

    own: OwnLawConfig = OwnLawConfig()
    learning: LearningConfig = LearningConfig()
    quiet: QuietConfig = QuietConfig()
    load_estimate: LoadEstimateConfig = LoadEstimateConfig()
    start: StartConfig = StartConfig()
    supervisory: SupervisoryConfig = SupervisoryConfig()
    timing: TimingConfig = TimingConfig()
    cycle: CycleConfig = CycleConfig()
    air: AirKnowledge = AirKnowledge()
    injector: InjectorKnowledge = InjectorKnowledge()
    valves: ValvesKnowledge = ValvesKnowledge()
    limits: LimitsConfig = LimitsConfig()
    protection: ProtectionConfig = ProtectionConfig()
    preset: Preset = Preset()
    tuning: Tuning | None = None

    @model_validator(mode="before")
    @classmethod
    def _law_with_file(cls, given: Any) -> Any:  # noqa: ANN401
        """Read a file as the name of a law: the law of that file."""
        name = given.get("name") if isinstance(given, dict) else None
        if not isinstance(name, str) or not name.endswith(SUFFIX):
            return given
        own = given.get("own") or {}
        return given | {"name": name_of(name), "own": {**own, "name": name_of(name), "file": name}}
