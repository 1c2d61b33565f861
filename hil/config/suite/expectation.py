"""An expectation: what must hold in a run, of what, and from when to when."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from hil.config.base import OneOf, Section
from hil.event_codes import MEANINGS
from hil.nearest import did_you_mean, nearest
from hil.wire.messages import OPERATING_MODES

ModeName = Annotated[str, OneOf((*OPERATING_MODES.values(), "running"))]
Statistic = Literal["mean", "rms", "final", "peak-to-peak", "spread"]
Seconds = Annotated[float, Field(ge=0.0, le=86_400.0)]
Positive = Annotated[float, Field(gt=0.0, le=1e12)]
Value = Annotated[float, Field(ge=-1e15, le=1e15)]

OF_A_SIGNAL: Final = ("min", "max", "tolerance", "rise_s", "settling_s", "overshoot")


class Expectation(Section):
    """One thing that must hold, from its beginning to its end.

    requirement: what it proves, for people and their tools; it stands in summary and JUnit file
    event: where it begins: an event of the scenario, or a code of the log (`misfire`, `mode safe`);
        if that did not happen, or was refused, the expectation is not met
    from_s: it begins so much later; without an event counted from the start
    until_s: it ends then, counted likewise; without it, it holds to the end of the run
    until_event: it ends with the first such event after its beginning, if there is one
    after_s: counts from the event, without one from the start: a deadline for within_mm, a
        beginning for peak_mm
    within_mm: the first dead centre after the last one outside this band about its set point comes
        no later than after_s; a later set point of the scenario ends it
    peak_mm: from after_s on no dead centre is further than this from its set point
    mode: the controller ends in it; running is generating, of an engine in which nothing ever fires
        motoring
    at_rest: whether the last speed is below 1 cm/s
    contacts: there were at most so many contacts with a head
    misfires_min: the plant reported at least so many misfires
    signal: a signal by its name (`hil signals`), or dead_centre.tdc_m, .error_m, .fuel_kg: of every
        dead centre, exactly
    statistic: judge this of the signal instead of each value; spread is its standard deviation
    min, max: the signal is nowhere below, nowhere above
    reference: what it is compared with: a number, or another signal's name
    recorded: the directory of a run whose same signal is the reference, at the same times
    tolerance: it differs from its reference nowhere by more
    relative: the tolerance is a share of the reference's size
    rise_s: from a tenth to nine tenths of the way to its final value it takes no longer
    settling_s: after so long it stays within the tolerance of its final value
    overshoot: it goes beyond its final value by no more than this share of the step
    within_s: after so long at the latest `then` has happened, or the signal is within its bounds
    then: an event that follows the beginning within within_s
    never: an event that does not happen
    order: events that happen one after the other, each after the one before it
    """

    requirement: str = Field(default="", max_length=200)
    event: str | None = None
    from_s: Seconds = 0.0
    until_s: Seconds | None = None
    until_event: str | None = None
    after_s: Seconds = 0.0
    within_mm: float | None = Field(default=None, gt=0.0, le=50.0)
    peak_mm: float | None = Field(default=None, gt=0.0, le=50.0)
    mode: ModeName | None = None
    at_rest: bool | None = None
    contacts: int | None = Field(default=None, ge=0)
    misfires_min: int | None = Field(default=None, ge=0)
    signal: str | None = None
    statistic: Statistic | None = None
    min: Value | None = None
    max: Value | None = None
    reference: Value | str | None = None
    recorded: str | None = None
    tolerance: Positive | None = None
    relative: bool = False
    rise_s: Seconds | None = None
    settling_s: Seconds | None = None
    overshoot: float | None = Field(default=None, ge=0.0, le=100.0)
    within_s: Seconds | None = None
    then: str | None = None
    never: str | None = None
    order: tuple[str, ...] | None = Field(default=None, min_length=2, max_length=32)

    @property
    def events(self) -> tuple[str, ...]:
        """Every event that it names."""
        named = (self.event, self.until_event, self.then, self.never, *(self.order or ()))
        return tuple(name for name in named if name is not None)

    @property
    def signals(self) -> tuple[str, ...]:
        """Every signal that it names."""
        named = (self.signal, self.reference if isinstance(self.reference, str) else None)
        return tuple(name for name in named if name is not None)

    def check_events(self, name: str, known: Collection[str]) -> None:
        """Refuse an event that neither the scenario nor any log has.

        Raises: ValueError naming the events that are known
        """
        for event in self.events:
            if event not in known and event not in MEANINGS:
                of_logs = ", ".join(nearest(event, MEANINGS, 0.0))
                raise ValueError(
                    f"expect.{name}.event: {event!r} is no event; known: "
                    f"{', '.join(known) or 'none'}; of the logs for instance: {of_logs}"
                    f"{did_you_mean(event, (*known, *MEANINGS))}"
                )

    @model_validator(mode="after")
    def _is_whole(self) -> Expectation:
        for wrong in (_wrong_window(self), _wrong_signal(self), _wrong_order(self)):
            if wrong:
                raise ValueError(wrong)
        return self


def _wrong_window(given: Expectation) -> str:
    if given.until_s is not None and given.until_s <= given.from_s:
        return f"until_s must be greater than from_s = {given.from_s:g}"
    if given.at_rest is not None and (given.until_s is not None or given.until_event is not None):
        return "at_rest: is of the end of the run; until_s and until_event are not accepted with it"
    return ""


def _wrong_signal(given: Expectation) -> str:
    demands = [key for key in OF_A_SIGNAL if getattr(given, key) is not None]
    if given.signal is None:
        needing = [*demands, *(k for k in ("statistic", "reference", "recorded")
                               if getattr(given, k) is not None)]  # fmt: skip
        return f"{needing[0]}: needs signal" if needing else ""
    if not demands:
        return f"signal: needs one of {', '.join(OF_A_SIGNAL)}"
    if given.min is not None and given.max is not None and given.min > given.max:
        return f"min must not exceed max = {given.max:g}"
    return _wrong_reference(given)


def _wrong_reference(given: Expectation) -> str:
    if given.reference is not None and given.recorded is not None:
        return "recorded: accepted is this or reference, not both"
    if given.settling_s is not None and given.tolerance is None:
        return "settling_s: needs tolerance"
    has_reference = given.reference is not None or given.recorded is not None
    if given.tolerance is not None and given.settling_s is None and not has_reference:
        return "tolerance: needs reference, recorded or settling_s"
    if has_reference and given.tolerance is None and given.rise_s is None is given.overshoot:
        return "reference: needs tolerance, rise_s, settling_s or overshoot"
    if given.statistic is not None and given.min is None is given.max:
        return "statistic: needs min or max"
    return ""


def _wrong_order(given: Expectation) -> str:
    bounded = given.signal is not None and (given.min is not None or given.max is not None)
    if given.then is not None and given.within_s is None:
        return "then: needs within_s"
    if given.within_s is not None and given.then is None and not bounded:
        return "within_s: needs then, or a signal with min or max"
    return ""
