"""TOML as it is read here: one reader of text, and of `KEY=VALUE` of a command line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hil.errors import ConfigError
from hil.files import read_regular

Tree = dict[str, Any]

_LONGEST_SHOWN = 80


def parse_toml(text: str) -> Tree:
    """Read TOML.

    Raises: ValueError with what is wrong
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # of `int`
        raise ValueError("a number of more digits than a program reads") from None
    except RecursionError:
        raise ValueError("values nested too deep") from None


def read_toml(path: Path) -> Tree:
    """Read a TOML file; a byte order mark in front of it, which some editors write, is none of it.

    Raises: ConfigError when it is missing, no regular file, unreadable or no TOML
    """
    try:
        return parse_toml(read_regular(path).decode("utf-8-sig"))
    except ValueError as error:
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
        return key, parse_toml(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key, value.strip()
    except ValueError as error:
        raise ConfigError(f"--set {key}={shown(value)}: {error}") from None


def assignments_of(texts: Sequence[str]) -> list[tuple[str, Any]]:
    """Read what --set was given: `key=value`, or `@FILE` for all keys of a parameter set.

    Raises: ConfigError
    """
    found: list[tuple[str, Any]] = []
    for text in texts:
        if text.startswith("@"):
            found += leaves(read_toml(Path(text[1:])))
        else:
            found.append(parse_assignment(text))
    return found


def leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, value) of tables in tables."""
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def shown(value: object) -> str:
    """A value on part of a line."""
    text = repr(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."
