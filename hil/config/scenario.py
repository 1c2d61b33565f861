"""A scenario: what is run, which events happen, and what is expected of the run."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.config.controller import ControllerConfig
from hil.config.events import Event
from hil.config.hardware import InputsConfig, OutputsConfig
from hil.config.plant import PlantConfig
from hil.config.process import (
    LinkConfig,
    LogConfig,
    LoopConfig,
    RealtimeConfig,
    RunConfig,
    SafetyConfig,
)
from hil.config.suite.expectation import Expectation
from hil.config.suite.stimulus import Stimulus, apart, check_events
from hil.wire.busload import check_fit

_HAD_TICKS = (("plant",), ("controller", "limits"))


def stale_as_time(tree: dict[str, Any]) -> dict[str, Any]:
    """Return the tree with `stale_ticks` of either side as `stale_s`, where that is not given."""
    for path in _HAD_TICKS:
        tree = _with_stale_time(tree, path, (tree.get("loop") or {}).get("rate_hz", 1000))
    return tree


def _with_stale_time(tree: Any, path: tuple[str, ...], rate_hz: Any) -> Any:  # noqa: ANN401
    if not isinstance(tree, dict):
        return tree
    if path:
        head, *rest = path
        return (
            tree | {head: _with_stale_time(tree[head], tuple(rest), rate_hz)}
            if head in tree
            else tree
        )
    ticks = tree.get("stale_ticks")
    if type(ticks) is not int or type(rate_hz) is not int or "stale_s" in tree:
        return tree
    left = {name: value for name, value in tree.items() if name != "stale_ticks"}
    return left | {"stale_s": (ticks - 0.5) / rate_hz}


class Scenario(Section):
    """The whole configuration of a run: this, resolved, is what each log carries.

    name: of the run and its directory
    description: for people
    begins: in the settled motion of the model, or at rest
    events: below
    stimuli: those among the events that follow a course, or wait for a condition
    expect: below
    """

    name: str = Field(default="unnamed", pattern=r"^[a-z0-9][a-z0-9-]{0,63}$")
    description: str = ""
    begins: Literal["settled", "at-rest"] = "settled"
    run: RunConfig = RunConfig()
    loop: LoopConfig = LoopConfig()
    link: LinkConfig = LinkConfig()
    realtime: RealtimeConfig = RealtimeConfig()
    safety: SafetyConfig = SafetyConfig()
    log: LogConfig = LogConfig()
    plant: PlantConfig = PlantConfig()
    controller: ControllerConfig = ControllerConfig()
    inputs: InputsConfig = InputsConfig()
    outputs: OutputsConfig = OutputsConfig()
    events: dict[str, Event] = Field(default_factory=dict)
    stimuli: dict[str, Stimulus] = Field(default_factory=dict)
    expect: dict[str, Expectation] = Field(default_factory=dict)

    @property
    def ticks(self) -> int:
        """How many ticks the run has."""
        return round(self.run.duration_s * self.loop.rate_hz)

    @model_validator(mode="before")
    @classmethod
    def _stale_as_a_time(cls, given: Any) -> Any:  # noqa: ANN401
        """Read the limits in ticks of earlier versions as the times that they were at this rate."""
        return apart(stale_as_time(given)) if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _bus_carries_the_rate(self) -> Scenario:
        if self.link.kind == "can":
            check_fit(self.loop.rate_hz, self.link.bitrate_bit_s)
        return self

    @model_validator(mode="after")
    def _expectations_name_events(self) -> Scenario:
        check_events(self.stimuli, self.events)
        for name, expectation in self.expect.items():
            expectation.check_events(name, (*self.events, *self.stimuli))
        return self
