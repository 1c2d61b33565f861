"""Whether all that a scenario names comes within its run: events, stimuli, expectations."""

from __future__ import annotations

from collections.abc import Iterator

from hil.config.scenario import Scenario
from hil.config.suite.expectation import Expectation


def beyond_the_end(scenario: Scenario) -> list[str]:
    """Tell by key what would begin, or be judged, only when the run has ended already."""
    return [*_late_events(scenario), *_late_expectations(scenario)]


def _late_events(scenario: Scenario) -> Iterator[str]:
    for name, at_s in _begun_s(scenario).items():
        if at_s >= scenario.run.duration_s:
            yield _told(scenario, f"events.{name}.at_s", at_s)


def _late_expectations(scenario: Scenario) -> Iterator[str]:
    for name, given in scenario.expect.items():
        begins_s = _begins_s(scenario, given)
        if begins_s is None:
            continue
        for key in ("from_s", "after_s") if given.peak_mm is not None else ("from_s",):
            after_s = getattr(given, key)
            if after_s and begins_s + after_s >= scenario.run.duration_s:
                yield _told(scenario, f"expect.{name}.{key}", begins_s + after_s)
        if given.until_s is not None and begins_s + given.until_s > scenario.run.duration_s:
            yield _told(scenario, f"expect.{name}.until_s", begins_s + given.until_s)


def _begun_s(scenario: Scenario) -> dict[str, float]:
    """When each event and stimulus begins at the earliest."""
    planned = {name: event.at_s for name, event in scenario.events.items()}
    return planned | {name: stimulus.at_s for name, stimulus in scenario.stimuli.items()}


def _begins_s(scenario: Scenario, given: Expectation) -> float | None:
    """When an expectation begins at the earliest; None where that is not known before the run."""
    return 0.0 if given.event is None else _begun_s(scenario).get(given.event)


def _told(scenario: Scenario, key: str, at_s: float) -> str:
    return (
        f"{key}: at {at_s:g} s of a run that ends at run.duration_s = {scenario.run.duration_s:g}"
    )
