"""Every configuration key with type, default, range and meaning, from the schema of its section.

What a key means is its `description`, or the line of its section's docstring that begins with it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, Final

from bench.dev.markdown import number, table
from hil.config.base import Section

Schema = dict[str, Any]
TITLES: Final = ("key", "type", "default", "accepted", "meaning")
_BOUNDS: Final = {
    "exclusiveMinimum": "above", "minimum": "from", "exclusiveMaximum": "below", "maximum": "to",
}  # fmt: skip
_NAMES: Final = {"integer": "whole number", "string": "text", "object": "table", "array": "list"}
_MEANING: Final = re.compile(r"^([a-z]\w*(?:, [a-z]\w*)*): ")


class Keys:
    """The keys of a configuration."""

    def __init__(self, section: type[Section]) -> None:
        self.schema: Schema = section.model_json_schema()
        self._definitions: Schema = self.schema.get("$defs", {})

    def sections(self, prefix: str = "", schema: Schema | None = None) -> Iterator[str]:
        """Yield the table of a section and those of the sections in it; not of named entries."""
        schema = self.schema if schema is None else schema
        inner = {
            name: value
            for name, given in schema["properties"].items()
            if (value := self._value(given)).get("properties")
        }
        rows = {k: v for k, v in schema["properties"].items() if k not in inner}
        title = f"### `[{prefix.rstrip('.')}]`" if prefix else "### At the top of the file"
        yield f"{title}\n\n{self._table(schema, rows, prefix)}"
        for name, value in inner.items():
            yield from self.sections(f"{prefix}{name}.", value)

    def alternatives(self, name: str) -> Iterator[str]:
        """Yield a table for each section among which `kind` chooses, under its kinds."""
        choice = self._value(self.schema["properties"][name]["additionalProperties"])
        kinds: dict[str, list[str]] = {}
        for kind, reference in self._mapping(choice).items():
            kinds.setdefault(reference, []).append(kind)
        for reference, names in kinds.items():
            section = self._definitions[reference.rpartition("/")[2]]
            rows = {k: v for k, v in section["properties"].items() if k != "kind"}
            title = ", ".join(f"`{kind}`" for kind in names)
            yield f"### {title}\n\n{self._table(section, rows, '')}"

    def entries(self, name: str) -> Iterator[str]:
        """Yield the table of the one section that all named entries have."""
        section = self._value(self.schema["properties"][name]["additionalProperties"])
        yield self._table(section, section["properties"], "")

    def _mapping(self, choice: Schema) -> dict[str, str]:
        """Reference by kind, of choices within a choice too."""
        found: dict[str, str] = {}
        for part in choice["oneOf"]:
            inner = self._value(part)
            found |= self._mapping(inner) if "oneOf" in inner else _kinds(part["$ref"], inner)
        return found

    def _value(self, schema: Schema) -> Schema:
        """The schema of a value that is given: no reference, no null."""
        parts = schema.get("anyOf", ())
        given = [part for part in parts if part.get("type") != "null"]
        if len(given) == 1:
            return self._value(given[0])
        if "$ref" in schema:
            return self._value(self._definitions[schema["$ref"].rpartition("/")[2]])
        return schema

    def _table(self, section: Schema, properties: Schema, prefix: str) -> str:
        """What a section is for, and a row for each of its keys."""
        told, meanings = _read_docstring(section.get("description", ""))
        required = section.get("required", ())
        rows = []
        for name, given in properties.items():
            value = self._value(given)
            default = "required" if name in required else _shown(given.get("default"))
            meaning = given.get("description") or meanings.get(name, "")
            key = f"`{prefix}{name}`"
            rows.append((key, _type(value), default, self._accepted(value), meaning))
        return f"{told}\n\n{table(TITLES, rows)}" if rows else f"{told}\n"

    def _accepted(self, value: Schema) -> str:
        """Choices, range or pattern."""
        if "const" in value or "enum" in value:
            return ", ".join(f"`{choice}`" for choice in _choices(value))
        if "pattern" in value:
            return f"`{value['pattern']}`"
        if "items" in value and "maxItems" in value:
            return f"{value.get('minItems', 0)} to {value['maxItems']} of them"
        if isinstance(value.get("additionalProperties"), dict):
            return self._accepted(self._value(value["additionalProperties"]))
        if "minimum" in value and value["minimum"] == value.get("maximum"):
            return number(value["minimum"])
        limits = [f"{word} {number(value[key])}" for key, word in _BOUNDS.items() if key in value]
        return " ".join(limits)


def _kinds(reference: str, section: Schema) -> dict[str, str]:
    """The kinds of one section."""
    return dict.fromkeys(_choices(section["properties"]["kind"]), reference)


def _choices(value: Schema) -> list[str]:
    """All that a value may be, of one that is declared by names."""
    return list(value["enum"]) if "enum" in value else [value["const"]]


def _read_docstring(text: str) -> tuple[str, dict[str, str]]:
    """Part a section's docstring into what it is for, and what its keys mean."""
    told: list[str] = []
    meanings: dict[str, str] = {}
    names: list[str] = []
    for line in filter(None, map(str.rstrip, text.splitlines())):
        found = _MEANING.match(line)
        if found:
            names = found[1].split(", ")
            meanings |= dict.fromkeys(names, line[found.end() :])
        elif names and line.startswith(" "):
            meanings |= {name: f"{meanings[name]} {line.strip()}" for name in names}
        else:
            names = []
            told.append(line)
    return "\n".join(told), meanings


def _type(value: Schema) -> str:
    """The kind of a value in the reader's words."""
    kind = str(value.get("type", "text"))
    return _NAMES.get(kind, kind)


def _shown(value: object) -> str:
    """A default as TOML would have it; nothing where there is none."""
    return "" if value in (None, {}) else f"`{json.dumps(value)}`"
