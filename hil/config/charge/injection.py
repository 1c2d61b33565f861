"""The injectors: what they are to the plant, and what the controller believes of them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hil.config.base import FIXED, Tunable
from hil.config.prototypes import DEFAULT
from hil.config.ranges import DeadTimeS, FlowKgS

FlowScale = Annotated[float, Field(gt=0.0, le=10.0)]
FilmKg = Annotated[float, Field(ge=0.0, le=1.0e-3, json_schema_extra=FIXED)]


class Injectors(Tunable):
    """Injector characteristic: nothing for the dead time, then the static flow until it closes.

    kind: into the cylinder, or into its intake port, where a share of the fuel wets the wall; what
        has not gone in when the intake closes waits for the cycle after
    film_share, film_time_s: part of the fuel that wets the wall of a port, and the time constant
        with which that film evaporates; assumed, of a warm engine
    intake_closes_m: distance from the head at which the intake closes, the engine's unless given
    film_kg: film in each port as its intake closes, in the settled motion in which a run may begin
    """

    kind: Literal["direct", "port"] = Field("direct", json_schema_extra=FIXED)
    static_flow_kg_s: FlowKgS = DEFAULT.injector_kg_s
    dead_time_s: DeadTimeS = DEFAULT.injector_dead_s
    film_share: Annotated[float, Field(ge=0.0, le=0.95)] = 0.3
    film_time_s: Annotated[float, Field(ge=1.0e-3, le=10.0)] = 0.25
    intake_closes_m: Annotated[float, Field(gt=0.0, le=0.2)] = DEFAULT.intake_closes_m
    film_kg: FilmKg | None = None


class InjectorConfig(Injectors):
    """What the plant's injectors are.

    scatter: standard deviation of one injection's mass, as a share
    drift_1_s: by what share more flows with each second of the run
    """

    flow_scale_left: FlowScale = 1.0
    flow_scale_right: FlowScale = 1.0
    scatter: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    drift_1_s: Annotated[float, Field(ge=-0.1, le=0.1)] = 0.0


class InjectorKnowledge(Injectors):
    """What the controller believes of the injectors: the plant's kind and film unless given.

    A film share of nought compensates none.
    """
