"""Every configuration key with type, unit, default, range and meaning, as tables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Final

from bench.dev.markdown import number, table
from hil.config.base import Section
from hil.names.leaves import Parameter, own_leaves, read_docstring, sections

TITLES: Final = ("key", "type", "unit", "default", "accepted", "live", "meaning")


def section_tables(whole: type[Section]) -> Iterator[str]:
    """Yield the table of a section and those of the sections in it; not of named entries."""
    for prefix, section in sections(whole):
        title = f"### `[{prefix.rstrip('.')}]`" if prefix else "### At the top of the file"
        yield f"{title}\n\n{section_table(section, prefix)}"


def section_table(section: type[Section], prefix: str = "") -> str:
    """What a section is for, and a row for each of its keys."""
    told, _ = read_docstring(section.__doc__ or "")
    rows = [_row(parameter) for parameter in own_leaves(section, prefix)]
    return f"{told}\n\n{table(TITLES, rows)}" if rows else f"{told}\n"


def _row(parameter: Parameter) -> tuple[str, ...]:
    default = "required" if parameter.required else _shown(parameter.default)
    live = "yes" if parameter.live else ""
    unit = "" if parameter.unit == "1" else parameter.unit
    return (
        f"`{parameter.key}`", parameter.kind, unit, default, _accepted(parameter), live,
        parameter.meaning,
    )  # fmt: skip


def _accepted(parameter: Parameter) -> str:
    """Choices, pattern or range, numbers as one writes them."""
    if parameter.choices:
        return ", ".join(f"`{choice}`" for choice in parameter.choices)
    if parameter.pattern:
        return f"`{parameter.pattern}`"
    if parameter.kind == "list":
        return parameter.accepted
    ends = [number(end) for end in (parameter.low, parameter.high) if end is not None]
    if len(ends) == 2 and ends[0] == ends[1]:
        return ends[0]
    words = [word for word in parameter.accepted.split() if word.isalpha()]
    return " ".join(f"{word} {end}" for word, end in zip(words, ends, strict=True))


def _shown(value: object) -> str:
    """A default as TOML would have it; nothing where there is none."""
    return "" if value in (None, {}) else f"`{json.dumps(value)}`"
