"""Parameters of a running pair over the command key: all that are live, set and asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.live import steer
from hil.wire.answers import CommandAnswer


def set_values(
    operator: steer.Operator, values: Mapping[str, Any], timeout_s: float
) -> tuple[CommandAnswer, ...]:
    """Change parameters, all or none; returns what each process says.

    Raises: ConfigError for a key of neither, LinkError when nobody answers
    """
    return tuple(steer.set_parameters(operator, values, timeout_s))


def get_values(operator: steer.Operator, timeout_s: float) -> dict[str, Any]:
    """Return the live parameters in force, by key.

    Raises: LinkError when a process does not answer
    """
    return dict(steer.values_of(operator, "", timeout_s))
