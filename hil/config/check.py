"""Checking a tree; what is wrong is one line that names file, key and what is accepted."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from hil.config.base import Section
from hil.errors import ConfigError
from hil.nearest import did_you_mean
from hil.toml import shown
from hil.wire.quantities import FieldError

_S = TypeVar("_S", bound=Section)

_QUOTED: Final = re.compile(r"'([^']*)'")


def check(section: type[_S], tree: Mapping[str, Any], origin: str) -> _S:
    """Check a tree and make it a section.

    Raises: ConfigError naming origin, key, the value given and what is accepted
    """
    found = _checked(section, origin, lambda: section.model_validate(tree))
    _check_types(tree, found, origin)
    return found


def check_json(section: type[_S], data: str | bytes, origin: str) -> _S:
    """Check what a process has written down of a section.

    Raises: ConfigError likewise
    """
    found = _checked(section, origin, lambda: section.model_validate_json(data))
    _check_types(json.loads(data), found, origin)
    return found


def _check_types(given: Any, found: Any, origin: str, key: str = "") -> None:  # noqa: ANN401
    """Refuse what was taken for a number or a switch and is written as something else.

    The validation itself takes `true` for 1 and `"1000"` for 1000, but also 1e3 for the whole
    number and a list for a tuple, as they should be.

    Raises: ConfigError
    """
    if isinstance(given, Mapping):
        for name, value in given.items():
            below = found.get(name) if isinstance(found, Mapping) else getattr(found, name, None)
            _check_types(value, below, origin, f"{key}.{name}".lstrip("."))
    elif isinstance(given, list) and isinstance(found, list | tuple):
        for number, (value, below) in enumerate(zip(given, found, strict=False)):
            _check_types(value, below, origin, f"{key}.{number}")
    elif isinstance(found, bool):
        if not isinstance(given, bool):
            raise ConfigError(f"{origin}: {key}: accepted is true or false (given: {shown(given)})")
    elif isinstance(found, int | float) and isinstance(given, bool | str):
        raise ConfigError(f"{origin}: {key}: accepted is a number (given: {shown(given)})")


def _checked(section: type[_S], origin: str, validated: Callable[[], _S]) -> _S:
    try:
        return validated()
    except ValidationError as error:
        raise ConfigError(_refusal(error, origin, section)) from None


def _refusal(error: ValidationError, origin: str, checked: type[Section]) -> str:
    """One line of a validation error: file, key, what was given, what is accepted."""
    first = error.errors(include_url=False)[0]
    parts = [str(part) for part in first["loc"]]
    key = ".".join(parts)
    more = error.error_count() - 1
    tail = f" (and {more} more)" if more else ""
    if first["type"] == "extra_forbidden":
        return f"{origin}: {key}: unknown key; accepted here: {_siblings(checked, parts)}{tail}"
    given = first["input"]
    told = f" (given: {shown(given)})" if not isinstance(given, dict) else ""
    message = first["msg"].removeprefix("Value error, ")
    if isinstance(first.get("ctx", {}).get("error"), FieldError):
        return f"{origin}: {key}.{message}{tail}"
    accepted = _accepted_range(checked, parts)
    hint = did_you_mean(given, _QUOTED.findall(str(first.get("ctx", {}).get("expected", ""))))
    return f"{origin}: {key or 'scenario'}: {message}{told}{accepted}{tail}{hint}"


def _section(checked: type[Section], parts: list[str]) -> dict[str, Any]:
    """JSON schema of the section that holds the last of these keys."""
    schema = checked.model_json_schema()
    definitions = schema.get("$defs", {})
    node: dict[str, Any] = schema
    for part in parts[:-1]:
        below = node.get("properties", {}).get(part)
        if below is None:
            below = _branch(node, part, definitions)
        node = _resolve(below, definitions)
    return node


def _branch(node: dict[str, Any], part: str, definitions: dict[str, Any]) -> dict[str, Any]:
    """Follow a named entry of a table of tables, or a branch that a `kind` selects."""
    mapping = node.get("discriminator", {}).get("mapping", {})
    if part in mapping:
        return {"$ref": mapping[part]}
    extra = node.get("additionalProperties")
    return extra if isinstance(extra, dict) else {}


def _resolve(node: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """Follow references and optional sections down to a table."""
    for key in ("anyOf", "allOf"):
        if key in node:
            tables = [n for n in node[key] if "$ref" in n]
            node = tables[0] if tables else node
    if "$ref" in node:
        return dict(definitions[node["$ref"].rsplit("/", 1)[-1]])
    return node


def _siblings(checked: type[Section], parts: list[str]) -> str:
    """Names of the keys that the section accepts, and what may have been meant, elsewhere too."""
    known = list(_section(checked, parts).get("properties", {}))
    hint = did_you_mean(parts[-1], known)
    if not hint:
        schema = checked.model_json_schema()
        hint = did_you_mean(".".join(parts), [*_keys(schema, schema.get("$defs", {}))])
    return f"{', '.join(known) or 'nothing'}{hint}"


def _keys(node: dict[str, Any], definitions: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield every key of a section and of the sections in it."""
    for name, below in node.get("properties", {}).items():
        yield f"{prefix}{name}"
        yield from _keys(_resolve(below, definitions), definitions, f"{prefix}{name}.")


def _accepted_range(checked: type[Section], parts: list[str]) -> str:
    """The range of a number from its schema, where it has one."""
    if not parts:
        return ""
    node = _section(checked, parts).get("properties", {}).get(parts[-1], {})
    options = [node, *node.get("anyOf", [])]
    low = next((n[k] for n in options for k in ("minimum", "exclusiveMinimum") if k in n), None)
    high = next((n[k] for n in options for k in ("maximum", "exclusiveMaximum") if k in n), None)
    if low is None and high is None:
        return ""
    return f"; accepted: {'' if low is None else low} to {'' if high is None else high}"
