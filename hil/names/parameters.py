"""Parameters: the leaves of the configuration, by the key that a file, `--set` and a command use.

Everything is read off the sections: unit and meaning, range, default, and whether a running engine
takes a change. There is no second list.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from functools import cache
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from hil.config.base import Section, value_of
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.names.leaves import Parameter, leaves, setting
from hil.nearest import did_you_mean
from hil.wire.quantities import shown

SETTINGS: Final = ("plant.own.settings", "controller.own.settings")
"""Tables of what a class of the user's declares; a running engine takes changes of them."""

_ConfigT = TypeVar("_ConfigT", bound=Section)


@cache
def parameters() -> Mapping[str, Parameter]:
    """Return all parameters by their keys, in the order of the configuration."""
    return {parameter.key: parameter for parameter in leaves(Scenario)}


@cache
def live(side: str) -> Mapping[str, Parameter]:
    """Return those of a side that a running engine takes a change of."""
    return {key: p for key, p in parameters().items() if p.live and p.side == side}


def find(pattern: str = "") -> list[Parameter]:
    """Return the parameters whose key a pattern matches (`*.kp`), or contains.

    Raises: ConfigError when there is none
    """
    found = [p for key, p in parameters().items() if matches(key, pattern)]
    if not found:
        hint = did_you_mean(pattern, parameters())
        raise ConfigError(f"{pattern!r} is no parameter, nor part of one (`hil parameters`){hint}")
    return found


def matches(name: str, pattern: str) -> bool:
    """Whether a name is meant: by a pattern with * or ?, else by a part of it."""
    return fnmatchcase(name, pattern) if "*" in pattern or "?" in pattern else pattern in name


def parameter_of(key: str) -> Parameter:
    """Return a parameter by its key.

    Raises: ConfigError when there is no such one, naming those that are like it
    """
    try:
        return _known(key)
    except ConfigError as error:
        raise ConfigError(f"{error}{did_you_mean(key, parameters())}") from None


def _known(key: str) -> Parameter:
    """Return a parameter by its key; to look for those that are like it takes a loop too long."""
    found = parameters().get(key)
    if found is None and key.rpartition(".")[0] in SETTINGS:
        return setting(key)
    if found is None:
        raise ConfigError(f"{shown(key)} is no parameter (`hil parameters` lists them)")
    return found


def settings(scenario: Scenario) -> list[Parameter]:
    """Return what a user's own law and engine of a run declare, which change as they run."""
    kinds = {bool: "boolean", float: "number", str: "text"}
    return [
        setting(f"{table}.{name}")._replace(kind=kinds[type(value)])
        for table in SETTINGS
        for name, value in value_of(scenario, table).items()
    ]


def apply(config: _ConfigT, changes: Mapping[str, object]) -> _ConfigT:
    """Return the configuration of a side with other values, checked whole.

    Raises: ConfigError naming the first key that is none, does not change while the engine runs, or
        has a value that is not accepted; or saying why the whole is not
    """
    tree: dict[str, Any] = dict(config.__dict__)
    for key, value in changes.items():
        parameter = _known(key)
        if not parameter.live:
            raise ConfigError(f"{key}: acts at the start of a run only (`hil parameters --live`)")
        node = tree
        *path, last = key.split(".")[1:]
        for part in path:
            below = node[part]
            node[part] = dict(below if isinstance(below, dict) else below.__dict__)
            node = node[part]
        node[last] = parameter.checked(value)
    try:
        return type(config).model_validate(tree)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise ConfigError(f"{where}: {first['msg'].removeprefix('Value error, ')}") from None
