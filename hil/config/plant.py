"""The plant's part of the configuration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_type_hints

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from hil.config.base import LIVE, OneOf, Section, Tunable
from hil.config.charge.ignition import IgnitionConfig
from hil.config.charge.injection import InjectorConfig
from hil.config.engine.models import (
    DETAILED_MODELS,
    KNOWN,
    MODELS,
    FmuConfig,
    OwnEngineConfig,
    table_of,
    with_file,
)
from hil.config.hardware import IndicatorConfig, WindingConfig
from hil.config.prototypes import DEFAULT, PROTOTYPES, Figures, Prototype, model_files, read_own
from hil.config.ranges import (
    STALE_S,
    LoadCoefficient,
    PressurePa,
    Restitution,
    StaleS,
    TemperatureK,
)

PrototypeName = Annotated[str, OneOf(PROTOTYPES)]


if TYPE_CHECKING:

    class EngineOverrides(Section):
        """Any of the figures, or none."""

else:
    EngineOverrides = create_model(
        "EngineOverrides",
        __base__=Section,
        __doc__="Single figures of the prototype replaced; what is not given stays its own.",
        **{
            name: (hint | None, None)
            for name, hint in get_type_hints(Figures, include_extras=True).items()
            if name in Figures.model_fields
        },
    )


class SensorConfig(Tunable):
    """What the position and velocity sensors add to the truth; zero means nothing.

    offset_x_m, offset_v_m_s: added to the truth; it drifts where it is changed bit by bit
    """

    noise_x_m: Annotated[float, Field(ge=0.0, le=1.0e-3)] = 0.0
    noise_v_m_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    resolution_x_m: Annotated[float, Field(ge=0.0, le=1.0e-3)] = 0.0
    resolution_v_m_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    offset_x_m: Annotated[float, Field(ge=-0.02, le=0.02)] = 0.0
    offset_v_m_s: Annotated[float, Field(ge=-5.0, le=5.0)] = 0.0


class DisturbanceConfig(Tunable):
    """What disturbs the engine all the time, beside the events of a scenario.

    load_scale: the load in force is so many times the commanded one, beside the scale of an event
    efficiency_low, efficiency_high: combustion efficiency, drawn anew for each combustion; that of
        an event takes its place
    efficiency_memory: correlation of a cylinder's efficiency with that of its cycle before
    manifold_scale: the manifold's pressure is so many times that of throttle and lag
    intake_warmer_k: by so much the trapped air is warmer than the engine's figure
    exhaust_late_s: by so much later the exhaust valves open, where lines move them
    """

    load_scale: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    efficiency_low: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    efficiency_high: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    efficiency_memory: Annotated[float, Field(ge=0.0, le=0.95)] = 0.0
    manifold_scale: Annotated[float, Field(gt=0.0, le=3.0)] = 1.0
    intake_warmer_k: Annotated[float, Field(ge=-100.0, le=200.0)] = 0.0
    exhaust_late_s: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0

    @model_validator(mode="after")
    def _efficiency_is_a_range(self) -> Self:
        if self.efficiency_low > self.efficiency_high:
            raise ValueError(
                f"efficiency_low = {self.efficiency_low:g}: accepted is at most efficiency_high ="
                f" {self.efficiency_high:g}"
            )
        return self


class AirConfig(Section):
    """The air path: throttle, manifold, and what the trapped air lets burn (thesis eq. 5.28).

    limit: whether the fast models burn no more fuel than their air is enough for; the thesis's
        have no such limit
    manifold_pa: pressure behind an open throttle, the engine's unless given
    temperature_k: of the trapped air, the engine's unless given
    lag_s: time constant with which the manifold follows the throttle
    rich_limit, lean_limit: lambda outside of which nothing burns; assumed, of petrol
    """

    limit: bool = False
    manifold_pa: PressurePa | None = None
    temperature_k: TemperatureK | None = None
    lag_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.05
    rich_limit: Annotated[float, Field(gt=0.0, le=1.0)] = 0.6
    lean_limit: Annotated[float, Field(ge=1.0, le=100.0)] = 1.7


_VALVE_ACTUATORS: dict[str, tuple[float, float, float]] = {
    "ideal": (0.0, 0.0, 0.0),
    "solenoid": (3.0e-3, 2.5e-3, 0.03e-3),
    "pneumatic": (6.0e-3, 8.0e-3, 0.25e-3),
}
"""Opening delay, closing delay and standard deviation of both [s], by kind; assumed."""


class ValvesConfig(Section):
    """Valve actuators: how much later than its line a valve moves, and what the piston leaves it.

    moved_by: the piston's programme, or the lines alone but for the settled motion in which a run
        may begin: there each valve follows the piston until its line's first pulse; the bench sets
        it from `controller.timing.valves`
    opening_delay_s, closing_delay_s, spread_s: those of the kind unless given; the spread is the
        standard deviation of one move
    pocket_m: depth of the pockets in the piston's crown: an open valve is struck nearer to the
        head than its lift less this
    """

    kind: Literal["ideal", "solenoid", "pneumatic"] = "ideal"
    moved_by: Literal["programme", "lines"] = "programme"
    opening_delay_s: Annotated[float, Field(ge=0.0, le=0.05)] | None = None
    closing_delay_s: Annotated[float, Field(ge=0.0, le=0.05)] | None = None
    spread_s: Annotated[float, Field(ge=0.0, le=5.0e-3)] | None = None
    pocket_m: Annotated[float, Field(ge=0.0, le=0.02)] = 3.5e-3

    @property
    def opening_s(self) -> float:
        """Opening delay in force."""
        return self._in_force(self.opening_delay_s, 0)

    @property
    def closing_s(self) -> float:
        """Closing delay in force."""
        return self._in_force(self.closing_delay_s, 1)

    @property
    def deviation_s(self) -> float:
        """Standard deviation in force."""
        return self._in_force(self.spread_s, 2)

    def _in_force(self, given: float | None, which: int) -> float:
        return _VALVE_ACTUATORS[self.kind][which] if given is None else given


class PlantConfig(Section):
    """Which engine, which model of it, and its actuators and sensors."""

    prototype: PrototypeName = DEFAULT.name
    own: OwnEngineConfig = OwnEngineConfig()
    model: Annotated[str, OneOf(MODELS, lambda _name: True)] = "harmonic"
    load_coefficient_n_s_m: LoadCoefficient | None = Field(
        default=None,
        description="of the engine's nominal use, with which the plant brakes in its safe state",
        json_schema_extra=LIVE,
    )
    ideal: bool = Field(
        default=False, description="an engine in full without heat to the wall and leakage"
    )
    fmu: FmuConfig = FmuConfig()
    engine: EngineOverrides = EngineOverrides()
    sensors: SensorConfig = SensorConfig()
    injector: InjectorConfig = InjectorConfig()
    air: AirConfig = AirConfig()
    valves: ValvesConfig = ValvesConfig()
    drive: Literal["programme", "commands"] = Field(
        "programme", description="what moves the machine of a four-stroke engine; set by the bench"
    )
    disturbance: DisturbanceConfig = DisturbanceConfig()
    spark_window_s: float | None = Field(
        None,
        gt=0.0,
        le=0.05,
        json_schema_extra=LIVE,
        description="longest time from spark to dead centre; none: compression alone tells",
    )
    ignition: IgnitionConfig = IgnitionConfig()
    indicator: IndicatorConfig = IndicatorConfig()
    winding: WindingConfig = WindingConfig()
    contact_restitution: Restitution = DEFAULT.contact_restitution
    stale_s: StaleS = Field(
        default=STALE_S, description="silence borne of the controller", json_schema_extra=LIVE
    )
    command_delay_ticks: Annotated[
        int, Field(ge=0, le=20, description="ticks by which commands act later than the wire's one")
    ] = 0

    @model_validator(mode="before")
    @classmethod
    def _model_with_file(cls, given: Any) -> Any:  # noqa: ANN401
        """Read `fmu:FILE` as the model fmu and its file, `./my.py` as the engine of that file."""
        return with_file(given) if isinstance(given, dict) else given

    @model_validator(mode="before")
    @classmethod
    def _prototype_with_file(cls, given: Any) -> Any:  # noqa: ANN401
        """Read `./my.toml` as the prototype that it is like, and what it has of its own."""
        file = given.get("prototype") if isinstance(given, dict) else None
        if not isinstance(file, str) or not file.endswith(".toml"):
            return given
        like, figures, models = read_own(Path(file))
        own = {"name": Path(file).stem, "figures": figures, "models": models}
        return given | {"prototype": like, "own": {**table_of(given.get("own")), **own}}

    @field_validator("model")
    @classmethod
    def _model_is_known(cls, model: str, info: ValidationInfo) -> str:
        """Accept a name that is not ours only where an engine is brought by it."""
        own = info.data.get("own")
        if own is None:
            return model
        return model if own.file or own.sha256 else KNOWN.checked(model)

    @model_validator(mode="after")
    def _unit_has_a_file(self) -> Self:
        if (self.model == "fmu") != bool(self.fmu.file):
            raise ValueError("model = 'fmu:FILE.fmu' needs a file, and fmu.file needs model 'fmu'")
        if self.own.file and self.model in MODELS:
            raise ValueError(f"own.file needs its model; model = {self.model!r} is one of ours")
        return self

    @model_validator(mode="after")
    def _ideal_leaves_something_out(self) -> Self:
        if self.ideal and self.model not in DETAILED_MODELS:
            accepted = ", ".join(DETAILED_MODELS)
            raise ValueError(f"ideal: model {self.model} has no such losses; accepted: {accepted}")
        return self

    @model_validator(mode="after")
    def _model_knows_the_engine(self) -> Self:
        if self.believed().chambers < 2 and self.model not in DETAILED_MODELS:
            raise ValueError(
                f"prototype {self.prototype} has one chamber; models that accept it: "
                + ", ".join(model_files(self.prototype))
            )
        return self

    def believed(self) -> Prototype:
        """Return the engine as both sides know it: the prototype, or the user's own like it."""
        known = PROTOTYPES[self.prototype]
        if not self.own.name:
            return known
        return Prototype.model_validate(
            known.model_dump() | self.own.figures | {"name": self.own.name}
        )

    def resolved_prototype(self) -> Prototype:
        """Return the prototype with this configuration's replacements, checked as a whole."""
        given: dict[str, Any] = self.engine.model_dump(exclude_none=True)
        if self.load_coefficient_n_s_m is not None:
            given["load_coefficient_n_s_m"] = self.load_coefficient_n_s_m
        return Prototype.model_validate(self.believed().model_dump() | given)
