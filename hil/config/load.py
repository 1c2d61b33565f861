"""Reading configuration: TOML text and overrides to one checked tree, or one clear line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from hil.config.check import check, check_json
from hil.config.scenario import Scenario
from hil.config.suite.cases import Case, cases_of, read_composed
from hil.errors import ConfigError
from hil.files import read_regular
from hil.nearest import listed
from hil.toml import Tree, shown

_S = TypeVar("_S", bound=Scenario)

_MOST_SHOWN = 12


def with_override(tree: Mapping[str, Any], key: str, value: Any) -> Tree:  # noqa: ANN401
    """Return the tree with one dotted key replaced or added.

    Raises: ConfigError when the key goes through something that is no table
    """
    changed = dict(tree)
    node, (*path, last) = changed, key.split(".")
    for depth, part in enumerate(path):
        below = node.get(part, {})
        if not isinstance(below, Mapping):
            reached = ".".join(path[: depth + 1])
            raise ConfigError(f"--set {key}: {reached} is a value ({shown(below)}), not a table")
        node[part] = node = dict(below)
    node[last] = value
    return changed


def build(tree: Mapping[str, Any], origin: str) -> Scenario:
    """Check a tree and make it a scenario.

    Raises: ConfigError naming origin, key, the value given and what is accepted
    """
    return check(Scenario, tree, origin)


def load(path: Path, overrides: Sequence[tuple[str, Any]] = ()) -> Scenario:
    """Read a scenario file that has one scenario, and apply overrides in their order.

    Raises: ConfigError naming file, key and what is accepted
    """
    case = only(cases_of(read_composed(path, Path), path), str(path))
    return overridden(case, str(path), overrides)


def only(cases: Sequence[Case], origin: str) -> Case:
    """Return the one case that there is.

    Raises: ConfigError naming those that there are
    """
    if len(cases) == 1:
        return cases[0]
    named = ", ".join(one.name for one in cases[:_MOST_SHOWN])
    more = f" and {len(cases) - _MOST_SHOWN} more" if len(cases) > _MOST_SHOWN else ""
    raise ConfigError(
        f"{origin}: has {len(cases)} cases; accepted is {origin}::CASE, of: {named}{more}"
    )


def overridden(case: Case, origin: str, overrides: Sequence[tuple[str, Any]] = ()) -> Scenario:
    """Make the scenario of a case, with overrides in their order.

    Raises: ConfigError naming origin, key and what is accepted
    """
    tree, where = case.tree, f"{origin}::{case.name}" if case.name else origin
    for key, value in overrides:
        _refuse_new_event(tree, key)
        tree = with_override(tree, key, value)
    return build(tree, f"{where} with --set" if overrides else where)


def read_scenario(path: Path) -> Scenario:
    """Read a scenario from TOML, or from the JSON that a run leaves behind.

    Raises: ConfigError naming file, key and what is accepted
    """
    return read_as(Scenario, path)


def read_as(section: type[_S], path: Path) -> _S:
    """Read a file of TOML or JSON as that kind of scenario."""
    if path.suffix != ".json":
        return check(section, read_composed(path, Path), str(path))
    return check_json(section, read_regular(path), str(path))


def _refuse_new_event(tree: Mapping[str, Any], key: str) -> None:
    """An override changes an event or expectation that exists; a typo must not make a new one."""
    table, _, rest = key.partition(".")
    name = rest.partition(".")[0]
    if table not in {"events", "expect"}:
        return
    present = tree.get(table, {})
    names = list(present) if isinstance(present, Mapping) else []
    if not name:
        raise ConfigError(f"--set {key}: accepted is {key}.NAME.KEY=value")
    if name not in names:
        raise ConfigError(
            f"--set {key}: this scenario has no {table}.{name}; it has: {listed(name, names)}"
        )
