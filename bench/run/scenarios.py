"""Scenarios: where they are found, and how one becomes the whole configuration of a run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hil import compiled
from hil.config.load import load
from hil.config.scenario import Scenario
from hil.errors import ConfigError

PACKAGED = compiled.root() / "bench" / "scenarios"


def packaged() -> tuple[Path, ...]:
    """Return the files of the scenarios that come with the project, by name."""
    return tuple(sorted(PACKAGED.glob("*.toml"), key=lambda path: path.stem))


def find(name: str) -> Path:
    """Return the file of a scenario given by name, or by a path that ends in .toml.

    Raises: ConfigError when there is none
    """
    if name.endswith(".toml"):
        path = Path(name)
        if not path.is_file():
            raise ConfigError(f"{name}: no such scenario file")
        return path
    known = {path.stem: path for path in packaged()}
    if name not in known:
        accepted = ", ".join(known)
        raise ConfigError(f"scenario {name!r}: accepted is a path to a .toml file, or: {accepted}")
    return known[name]


def read(name: str, overrides: Iterable[tuple[str, Any]] = ()) -> Scenario:
    """Read a scenario by name or path and apply overrides in their order.

    Raises: ConfigError naming file, key and what is accepted
    """
    return load(find(name), overrides)
