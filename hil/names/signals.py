"""Signals: the fields of the logged topics, by process, topic and field, with unit and rate.

`plant.truth.x_m` is the field x_m of /truth in the log of the plant; of an array each item is a
signal of its own, `controller.actuator.pulse_channel.0`. Everything is read off the topics.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import NamedTuple

from hil.errors import ConfigError
from hil.log import topics
from hil.log.records import BOTH_SIDES, SCALARS, Field, Topic, scalar_of
from hil.names.parameters import matches
from hil.nearest import did_you_mean


class Signal(NamedTuple):
    """One field of a logged topic, or an item of one that is an array.

    side: the process whose log it is in
    item: which one of an array, None of a single value
    type: ROS 2 type of the value
    rate: how often there is a value: tick, stroke, or occasion
    """

    name: str
    side: str
    topic: str
    field: str
    item: int | None
    type: str
    unit: str
    rate: str
    meaning: str

    @property
    def is_number(self) -> bool:
        """Whether it can be plotted: no text and no bytes."""
        return self.type in SCALARS

    def table(self) -> dict[str, object]:
        """Return it as JSON tells it."""
        return self._asdict()


@cache
def signals() -> Mapping[str, Signal]:
    """Return all signals by their names, the plant's first."""
    every = ((side, topic) for side in BOTH_SIDES for topic in topics.EVERY if side in topic.sides)
    return {signal.name: signal for side, topic in every for signal in _of(side, topic)}


def find(pattern: str = "") -> list[Signal]:
    """Return the signals whose name a pattern matches (`*.x_m`), or contains.

    Raises: ConfigError when there is none
    """
    found = [signal for name, signal in signals().items() if matches(name, pattern)]
    if not found:
        hint = did_you_mean(pattern, signals())
        raise ConfigError(f"{pattern!r} is no signal, nor part of one (`hil signals`){hint}")
    return found


def _of(side: str, topic: Topic) -> Iterator[Signal]:
    for field in topic.layout.fields:
        yield from _of_field(side, topic, field)


def _of_field(side: str, topic: Topic, field: Field) -> Iterator[Signal]:
    name = f"{side}{topic.name.replace('/', '.')}.{field.name}"
    count = scalar_of(field.type)[2] if field not in topic.layout.variable else None
    kind = field.type if count is None else field.type.partition("[")[0]
    rest = (kind, field.unit, topic.rate, field.text)
    if count is None:
        yield Signal(name, side, topic.name, field.name, None, *rest)
        return
    for item in range(count):
        yield Signal(f"{name}.{item}", side, topic.name, field.name, item, *rest)
