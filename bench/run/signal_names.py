"""Names of signals: a field of a logged topic of one side, or of every dead centre."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from bench.run.directory import opened
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.log import topics

DEAD_CENTRE: Final = "dead_centre"
_OF_DEAD_CENTRES: Final = ("tdc_m", "error_m", "fuel_kg", "x_m", "tdc_ref_m")
_STAMPS: Final = {"tick", "t_ns", "index"}
_TOPICS: Final = {
    "plant": (topics.SENSOR, topics.TRUTH, topics.TIMING, topics.ACTUATOR),
    "controller": (topics.SENSOR, topics.ACTUATOR, topics.STROKE, topics.DEMAND, topics.TIMING),
}


class Signal(NamedTuple):
    """Where a signal is logged: by which side, under which topic and field."""

    side: str
    topic: str
    field: str


@lru_cache(maxsize=1)
def known() -> dict[str, Signal]:
    """Every signal by its name, as in `plant.sensor.p_left_pa`."""
    return dict(_declared())


def _declared() -> Iterator[tuple[str, Signal]]:
    for own_field in _OF_DEAD_CENTRES:
        yield f"{DEAD_CENTRE}.{own_field}", Signal(DEAD_CENTRE, "/truth", own_field)
    for side, own in _TOPICS.items():
        for topic in own:
            for field in topic.layout.fields:
                if field.name not in _STAMPS and "[" not in field.type:
                    name = f"{side}{topic.name.replace('/', '.')}.{field.name}"
                    yield name, Signal(side, topic.name, field.name)


def signal_of(name: str) -> Signal:
    """Return the signal of a name.

    Raises: ConfigError naming the nearest ones
    """
    found = known().get(name)
    if found is None:
        near = get_close_matches(name, known(), 5, 0.3)
        raise ConfigError(
            f"signal {name!r}: no such signal; accepted: {', '.join(near or known())}"
        )
    return found


def check_expectations(scenario: Scenario) -> None:
    """Refuse what no run could be judged by: an unknown signal, a recorded run that is not there.

    Raises: ConfigError naming the key
    """
    for name, expectation in scenario.expect.items():
        where = f"{scenario.name}: expect.{name}"
        for signal in expectation.signals:
            try:
                signal_of(signal)
            except ConfigError as error:
                raise ConfigError(f"{where}: {error}") from None
        if expectation.recorded is not None:
            try:
                opened(Path(expectation.recorded))
            except ConfigError as error:
                raise ConfigError(f"{where}.recorded: {error}") from None
