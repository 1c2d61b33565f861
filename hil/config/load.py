"""Reading configuration: TOML text and overrides to one checked tree, or one clear line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from hil.config.base import Tree, parse_toml, read_toml
from hil.config.check import check, check_json, shown
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.files import read_regular

_S = TypeVar("_S", bound=Scenario)


def parse_assignment(text: str) -> tuple[str, Any]:
    """Read `key=value` of --set; the value is written as in TOML, quotes may be left out.

    Raises: ConfigError when there is no "=" or no key
    """
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key or not all(key.split(".")):
        raise ConfigError(f"--set {text!r}: accepted is key=value, as in run.duration_s=2.5")
    try:
        return key, parse_toml(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key, value.strip()
    except ValueError as error:
        raise ConfigError(f"--set {key}={shown(value)}: {error}") from None


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


def load(path: Path, overrides: Iterable[tuple[str, Any]] = ()) -> Scenario:
    """Read a scenario file and apply overrides in their order."""
    tree = beside(read_toml(path), path)
    origin = str(path)
    for key, value in overrides:
        _refuse_new_event(tree, key)
        tree = with_override(tree, key, value)
        origin = f"{path} with --set"
    return build(tree, origin)


def beside(tree: Tree, path: Path) -> Tree:
    """Return the tree of a file; other files that it names by relative paths are beside it."""
    for table, key in (("expect", "recorded"), ("events", "file")):
        entries = tree.get(table)
        if isinstance(entries, dict):
            anchored = {name: _anchored(entry, key, path) for name, entry in entries.items()}
            tree = tree | {table: anchored}
    return tree


def _anchored(entry: Any, key: str, path: Path) -> Any:  # noqa: ANN401
    given = entry.get(key) if isinstance(entry, dict) else None
    if not isinstance(given, str) or Path(given).is_absolute():
        return entry
    return entry | {key: str((path.parent / given).resolve())}


def read_scenario(path: Path) -> Scenario:
    """Read a scenario from TOML, or from the JSON that a run leaves behind.

    Raises: ConfigError naming file, key and what is accepted
    """
    return read_as(Scenario, path)


def read_as(section: type[_S], path: Path) -> _S:
    """Read a file of TOML or JSON as that kind of scenario."""
    if path.suffix != ".json":
        return check(section, read_toml(path), str(path))
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
        known = ", ".join(names) or "none"
        raise ConfigError(f"--set {key}: this scenario has no {table}.{name}; it has: {known}")
