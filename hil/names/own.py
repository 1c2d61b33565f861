"""The topic of a law of the user's own under the names that it declares."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Final

from hil.errors import ConfigError
from hil.log.records import Field, Record, Topic
from hil.log.topics import LAW
from hil.names.leaves import unit_of

MOST: Final = 8
"""Signals that a record has room for."""

_NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,40}")


def checked(signals: Any, origin: str) -> dict[str, str]:  # noqa: ANN401
    """Return what a class declares: the meaning of each of its signals by its name.

    Raises: ConfigError
    """
    if not isinstance(signals, Mapping) or len(signals) > MOST:
        raise ConfigError(f"{origin}: signals: accepted is a table of at most {MOST} of them")
    for name in signals:
        if not isinstance(name, str) or not _NAME.fullmatch(name) or name in ("tick", "t_ns"):
            raise ConfigError(f"{origin}: signals: {name!r}: accepted is a name like error_m")
    return {name: str(meaning) for name, meaning in signals.items()}


def law_topic(signals: Mapping[str, str]) -> Topic:
    """Return /law with a field for each signal, in the place of its item in the array."""
    fields: dict[str, Any] = {
        name: Annotated[float, Field("float64", text, unit_of(name))]
        for name, text in signals.items()
    }
    rest = MOST - len(fields)
    if rest:
        fields["unused"] = Annotated[tuple[float, ...], Field(f"float64[{rest}]", "nothing")]
    hints = {name: LAW.record.__annotations__[name] for name in ("tick", "t_ns")}
    told = {
        "__annotations__": hints | fields, "__doc__": LAW.record.__doc__,
        "__module__": LAW.record.__module__,
    }  # fmt: skip
    return Topic(LAW.name, LAW.channel_id, type("OfLaw", (Record,), told), LAW.rate, LAW.sides)
