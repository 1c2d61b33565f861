"""Reading configuration: TOML text and overrides to one checked tree, or one clear line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.wire.quantities import FieldError

Tree = dict[str, Any]

_LONGEST_SHOWN = 80


def read_toml(path: Path) -> Tree:
    """Read a TOML file.

    Raises: ConfigError when it is missing, unreadable or no TOML
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from None


def parse_assignment(text: str) -> tuple[str, Any]:
    """Read `key=value` of --set; the value is written as in TOML, quotes may be left out.

    Raises: ConfigError when there is no "=" or no key
    """
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key or not all(key.split(".")):
        raise ConfigError(f"--set {text!r}: accepted is key=value, as in run.duration_s=2.5")
    try:
        return key, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key, value.strip()


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
            raise ConfigError(f"--set {key}: {reached} is a value ({_shown(below)}), not a table")
        node[part] = node = dict(below)
    node[last] = value
    return changed


def build(tree: Mapping[str, Any], origin: str) -> Scenario:
    """Check a tree and make it a scenario.

    Raises: ConfigError naming origin, key, the value given and what is accepted
    """
    try:
        return Scenario.model_validate(tree)
    except ValidationError as error:
        raise ConfigError(describe(error, origin)) from None


def load(path: Path, overrides: Iterable[tuple[str, Any]] = ()) -> Scenario:
    """Read a scenario file and apply overrides in their order."""
    tree = read_toml(path)
    origin = str(path)
    for key, value in overrides:
        _refuse_new_event(tree, key)
        tree = with_override(tree, key, value)
        origin = f"{path} with --set"
    return build(tree, origin)


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


def describe(error: ValidationError, origin: str) -> str:
    """One line of a validation error: file, key, what was given, what is accepted."""
    first = error.errors(include_url=False)[0]
    parts = [str(part) for part in first["loc"]]
    key = ".".join(parts)
    more = error.error_count() - 1
    tail = f" (and {more} more)" if more else ""
    if first["type"] == "extra_forbidden":
        return f"{origin}: {key}: unknown key; accepted here: {_siblings(parts)}{tail}"
    given = first["input"]
    shown = f" (given: {_shown(given)})" if not isinstance(given, dict) else ""
    message = first["msg"].removeprefix("Value error, ")
    if isinstance(first.get("ctx", {}).get("error"), FieldError):
        return f"{origin}: {key}.{message}{tail}"
    accepted = _accepted_range(parts)
    return f"{origin}: {key or 'scenario'}: {message}{shown}{accepted}{tail}"


def _shown(value: object) -> str:
    """A value on part of a line."""
    text = repr(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def _section(parts: list[str]) -> dict[str, Any]:
    """JSON schema of the section that holds the last of these keys."""
    schema = Scenario.model_json_schema()
    definitions = schema.get("$defs", {})
    node: dict[str, Any] = schema
    for part in parts[:-1]:
        below = node.get("properties", {}).get(part)
        if below is None:
            below = node.get("additionalProperties")
        node = _resolve(below if isinstance(below, dict) else {}, definitions)
    return node


def _resolve(node: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """Follow references and optional sections down to a table."""
    for key in ("anyOf", "allOf"):
        if key in node:
            tables = [n for n in node[key] if "$ref" in n]
            node = tables[0] if tables else node
    if "$ref" in node:
        return dict(definitions[node["$ref"].rsplit("/", 1)[-1]])
    return node


def _siblings(parts: list[str]) -> str:
    """Names of the keys that the section accepts."""
    return ", ".join(_section(parts).get("properties", {})) or "nothing"


def _accepted_range(parts: list[str]) -> str:
    """The range of a number from its schema, where it has one."""
    if not parts:
        return ""
    node = _section(parts).get("properties", {}).get(parts[-1], {})
    options = [node, *node.get("anyOf", [])]
    low = next((n[k] for n in options for k in ("minimum", "exclusiveMinimum") if k in n), None)
    high = next((n[k] for n in options for k in ("maximum", "exclusiveMaximum") if k in n), None)
    if low is None and high is None:
        return ""
    return f"; accepted: {'' if low is None else low} to {'' if high is None else high}"
