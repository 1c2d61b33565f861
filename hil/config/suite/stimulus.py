"""A stimulus: what a scenario does to a parameter, by which course, and from when to when."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.config.events import COURSES, Event
from hil.event_codes import MEANINGS
from hil.nearest import did_you_mean, listed
from hil.toml import Tree

Seconds = Annotated[float, Field(ge=0.0, le=1e6)]
Duration = Annotated[float, Field(gt=0.0, le=1e6)]
Number = Annotated[float, Field(ge=-1e15, le=1e15)]
Kind = Literal["step", "ramp", "sine", "pulse", "noise", "playback", "command"]

MOST_SAMPLES: Final = 200_000

_OF_KIND: Final[Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "step": (("value",), ()),
    "ramp": (("value", "over_s"), ("start",)),
    "sine": (("amplitude", "frequency_hz"), ("value", "phase_rad")),
    "pulse": (("value", "width_s"), ()),
    "noise": (("sigma",), ("value", "hold_s")),
    "playback": ((), ("file", "column", "times", "between", "scale", "offset", "samples")),
    "command": (("command",), ()),
}
"""By kind the keys of its course: those that it needs, and those that it may have."""

_OF_COURSES: Final = {key for needed, allowed in _OF_KIND.values() for key in (*needed, *allowed)}
_OF_CONDITIONS: Final = ("when", "until", "repeat", "every_s")


class Condition(Section):
    """When something begins or ends: a signal is somewhere or passes a value, or an event happens.

    signal: of the side that the stimulus belongs to
    above, below: it holds while the signal is there
    rises_through, falls_through: it holds in the tick in which the signal has passed the value
    event: an event of that side: another one of the scenario, or a code of its log
    after_s: it counts so much later
    """

    signal: str | None = None
    above: Number | None = None
    below: Number | None = None
    rises_through: Number | None = None
    falls_through: Number | None = None
    event: str | None = None
    after_s: Seconds = 0.0

    @model_validator(mode="after")
    def _is_one(self) -> Condition:
        bounds = (self.above, self.below, self.rises_through, self.falls_through)
        given = sum(bound is not None for bound in bounds)
        if (self.event is None) == (self.signal is None) or given != (self.signal is not None):
            raise ValueError(
                "accepted: event, or signal with one of above, below, rises_through, falls_through"
            )
        return self


class Stimulus(Section):
    """What is done to a parameter: an entry of [events] of the kinds step to playback.

    kind: the course; `command` is another event with a condition or repeated
    parameter: key of a parameter that may change while the engine runs (`hil parameters`)
    command: of the kind `command`: the event
    at_s: it begins at this time of the run, or from then on when its condition holds
    when: it begins when this holds
    until: it ends when this holds
    until_s: it ends at this time of the run
    duration_s: it ends so long after it began
    repeat: so often, each time so much later (every_s), or whenever its condition holds anew
    every_s: from one beginning to the next
    hold: at its end the last value stays; else the parameter is again what it was
    added: added to what the parameter has, instead of in its place
    value: of a step or pulse; end of a ramp; middle of a sine or noise (what the parameter has)
    start: of a ramp (what the parameter has)
    over_s: how long a ramp rises
    amplitude, frequency_hz, phase_rad: of a sine
    width_s: of a pulse
    sigma: standard deviation of noise, which stays within four of it
    hold_s: so long noise keeps its value; without it a tick
    file: CSV or MCAP file to play back, beside the scenario's
    column: its column, or signal; of a file with one column that one
    times: column of a CSV file that has the times in s
    between: samples are held, or joined by lines
    scale, offset: what is played is scale times the column, and offset
    samples: times and values of what is played, as read from the file
    """

    kind: Kind
    parameter: str = ""
    command: Event | None = None
    at_s: Seconds = 0.0
    when: Condition | None = None
    until: Condition | None = None
    until_s: Duration | None = None
    duration_s: Duration | None = None
    repeat: int = Field(default=1, ge=1, le=100_000)
    every_s: Duration | None = None
    hold: bool = False
    added: bool = False
    value: Number | None = None
    start: Number | None = None
    over_s: Duration | None = None
    amplitude: Number | None = None
    frequency_hz: float | None = Field(default=None, gt=0.0, le=1e6)
    phase_rad: float | None = Field(default=None, ge=-100.0, le=100.0)
    width_s: Duration | None = None
    sigma: float | None = Field(default=None, ge=0.0, le=1e15)
    hold_s: Duration | None = None
    file: str | None = None
    column: str | None = None
    times: str | None = None
    between: Literal["held", "line"] | None = None
    scale: Number | None = None
    offset: Number | None = None
    samples: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    @property
    def conditions(self) -> dict[str, Condition]:
        """The conditions that it has, by key."""
        found = {"when": self.when, "until": self.until}
        return {key: condition for key, condition in found.items() if condition is not None}

    @property
    def side(self) -> str:
        """Who acts on it: plant or controller."""
        if self.command is not None:
            return self.command.to
        return self.parameter.partition(".")[0]

    @model_validator(mode="after")
    def _has_what_its_kind_needs(self) -> Stimulus:
        needed, allowed = _OF_KIND[self.kind]
        given = {key for key in _OF_COURSES if getattr(self, key) is not None}
        for key in needed:
            if key not in given:
                raise ValueError(f"{key}: a {self.kind} needs it")
        for key in sorted(given - {*needed, *allowed}):
            accepted = listed(key, (*needed, *allowed))
            raise ValueError(f"{key}: no key of a {self.kind}; its own are: {accepted}")
        if self.kind == "playback" and self.file is None and self.samples is None:
            raise ValueError("file: a playback needs it")
        return self

    @model_validator(mode="after")
    def _has_its_parameter_and_its_end(self) -> Stimulus:
        if self.kind != "command" and not self.parameter:
            raise ValueError(f"parameter: a {self.kind} needs it")
        if self.until_s is not None and self.until_s <= self.at_s:
            raise ValueError(f"until_s must be greater than at_s = {self.at_s:g}")
        if self.repeat > 1 and self.every_s is None and self.when is None:
            raise ValueError("repeat: needs every_s or when")
        if self.every_s is not None and (self.duration_s or 0.0) > self.every_s:
            raise ValueError(f"duration_s must not exceed every_s = {self.every_s:g}")
        return self


def apart(tree: Tree) -> Tree:
    """Return a scenario's tree with the stimuli among its events in a table of their own."""
    events = tree.get("events")
    if not isinstance(events, Mapping):
        return tree
    stimuli = {name: _stimulus_of(event) for name, event in events.items() if _is_stimulus(event)}
    if not stimuli:
        return tree
    rest = {name: event for name, event in events.items() if name not in stimuli}
    return {**tree, "events": rest, "stimuli": {**(tree.get("stimuli") or {}), **stimuli}}


def _is_stimulus(event: Any) -> bool:  # noqa: ANN401
    if not isinstance(event, Mapping):
        return False
    return event.get("kind") in COURSES or any(key in event for key in _OF_CONDITIONS)


def _stimulus_of(event: Mapping[str, Any]) -> dict[str, Any]:
    """A command with a condition, or repeated, as the stimulus that it is."""
    if event.get("kind") in COURSES:
        return dict(event)
    own = {key: event[key] for key in (*_OF_CONDITIONS, "at_s") if key in event}
    command = {key: value for key, value in event.items() if key not in _OF_CONDITIONS}
    return {"kind": "command", "command": {"at_s": 0.0, **command}, **own}


def check_events(stimuli: Mapping[str, Stimulus], events: Mapping[str, Any]) -> None:
    """Refuse a condition on an event that is none.

    Raises: ValueError naming those that are known
    """
    known = (*events, *stimuli)
    for name, stimulus in stimuli.items():
        for key, condition in stimulus.conditions.items():
            event = condition.event
            if event is not None and event not in known and event not in MEANINGS:
                hint = did_you_mean(event, (*known, *MEANINGS))
                raise ValueError(
                    f"events.{name}.{key}: {event!r} is no event; known: {', '.join(known)}{hint}"
                )
