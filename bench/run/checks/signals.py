"""Signals by name: those of the logs, and those of every dead centre, exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

from bench.run.directory import opened
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.names.signals import signals
from hil.nearest import did_you_mean

DEAD_CENTRE: Final = "dead_centre"
_OF_DEAD_CENTRES: Final = ("tdc_m", "error_m", "fuel_kg", "x_m", "tdc_ref_m")


class Source(NamedTuple):
    """Where a signal is read: in the log of which side, under which topic, field and item."""

    side: str
    topic: str
    field: str
    item: int | None = None


def source_of(name: str) -> Source:
    """Return where the signal of a name is read.

    Raises: ConfigError naming the nearest ones when there is none, or it is no number
    """
    side, _, field = name.partition(".")
    if side == DEAD_CENTRE and field in _OF_DEAD_CENTRES:
        return Source(side, "/truth", field)
    found = signals().get(name)
    if found is not None and found.is_number:
        return Source(found.side, found.topic, found.field, found.item)
    known = [*(n for n, s in signals().items() if s.is_number),
             *(f"{DEAD_CENTRE}.{field}" for field in _OF_DEAD_CENTRES)]  # fmt: skip
    why = "no such signal" if found is None else "no number"
    raise ConfigError(
        f"signal {name!r}: {why} (`hil signals` lists them){did_you_mean(name, known)}"
    )


def check_expectations(scenario: Scenario) -> None:
    """Refuse what no run could be judged by: an unknown signal, a recorded run that is not there.

    Raises: ConfigError naming the key
    """
    for name, expectation in scenario.expect.items():
        where = f"{scenario.name}: expect.{name}"
        for signal in expectation.signals:
            try:
                source_of(signal)
            except ConfigError as error:
                raise ConfigError(f"{where}: {error}") from None
        if expectation.recorded is not None:
            try:
                opened(Path(expectation.recorded))
            except ConfigError as error:
                raise ConfigError(f"{where}.recorded: {error}") from None
