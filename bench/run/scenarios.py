"""Scenarios: where they are found, and how one becomes the whole configuration of a run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench.run.checks.times import beyond_the_end
from hil import compiled
from hil.config.load import only, overridden
from hil.config.scenario import Scenario
from hil.config.suite.cases import Case, cases_of, read_composed, table_cases
from hil.errors import ConfigError
from hil.nearest import did_you_mean, listed
from hil.toml import Tree

_LONGEST_NAME, _MOST_SHOWN = 64, 12
_OF_CAN = {"link.bus", "link.bitrate_bit_s"}
"""Keys that only a CAN link takes notice of."""

PACKAGED = compiled.root() / "bench" / "scenarios"


def packaged() -> tuple[Path, ...]:
    """Return the files of the scenarios that come with the project, by name."""
    return tuple(sorted(PACKAGED.glob("*.toml"), key=lambda path: path.stem))


def find(name: str) -> Path:
    """Return the file of a scenario given by name, or by a path that ends in .toml.

    Raises: ConfigError when there is none
    """
    if name.endswith((".toml", ".csv")):
        path = Path(name)
        if not path.is_file():
            near = [str(other) for other in path.parent.glob(f"*{path.suffix}")]
            raise ConfigError(f"{name}: no such scenario file{did_you_mean(str(path), near)}")
        return path
    known = {path.stem: path for path in packaged()}
    if name not in known:
        raise ConfigError(
            f"scenario {name!r}: accepted is a path to a .toml file, or: {listed(name, known)}"
        )
    return known[name]


def read(name: str, overrides: Sequence[tuple[str, Any]] = ()) -> Scenario:
    """Read a scenario by name or path, or FILE::CASE of many, and apply overrides in their order.

    Raises: ConfigError naming file, key and what is accepted
    """
    found = read_cases(name)
    only([one.case for one in found], name)
    return found[0].scenario(overrides)


class Found(NamedTuple):
    """One of the scenarios that a name stands for.

    label: as it is told and found again: NAME, FILE or FILE::CASE
    """

    label: str
    origin: str
    case: Case

    def scenario(self, overrides: Sequence[tuple[str, Any]] = ()) -> Scenario:
        """Make the scenario, with overrides in their order; a case adds its name to the file's.

        Raises: ConfigError naming file, key and what is accepted
        """
        scenario = overridden(self.case, self.origin, overrides)
        _check_changes(scenario, self.label, {key for key, _ in overrides})
        if not self.case.name:
            return scenario
        return scenario.model_copy(update={"name": _run_name(scenario.name, self.case.name)})


def _check_changes(scenario: Scenario, label: str, changed: set[str]) -> None:
    """Refuse what would have no effect: a bus without its link, what comes after the end.

    A run that is made shorter than its file has it does without what came later.

    Raises: ConfigError naming the key
    """
    without_use = sorted(changed & _OF_CAN) if scenario.link.kind != "can" else []
    if without_use:
        raise ConfigError(
            f"{label}: {without_use[0]}: the link is {scenario.link.kind}; accepted with"
            " link.kind = 'can' (--link can)"
        )
    late = beyond_the_end(scenario)
    if late and "run.duration_s" not in changed:
        raise ConfigError(f"{label}: {late[0]}; accepted is what comes before that")


def tree_of(name: str) -> Tree:
    """Return the keys of a scenario by name or path, with what it includes.

    Raises: ConfigError when there is none, or it has cases
    """
    found = read_cases(name)
    return only([one.case for one in found], name).tree


def _run_name(name: str, case: str) -> str:
    """What the run of a case is called: as a directory may be."""
    plain = re.sub(r"[^a-z0-9]+", "-", f"{name}-{case}".lower()).strip("-")
    return plain[:_LONGEST_NAME].rstrip("-")


def read_cases(name: str) -> list[Found]:
    """Return every scenario that a name or path stands for; FILE::CASE is one of them.

    Raises: ConfigError naming file and key
    """
    file, _, wanted = name.partition("::")
    path = find(file)
    is_table = path.suffix == ".csv"
    cases = table_cases(path, find) if is_table else cases_of(read_composed(path, find), path)
    found = [Found(f"{file}::{c.name}" if c.name else file, str(path), c) for c in cases]
    if not wanted:
        return found
    chosen = [one for one in found if one.case.name == wanted]
    if not chosen:
        hint = did_you_mean(wanted, [one.case.name for one in found])
        raise ConfigError(f"{file}: no case {wanted!r}; accepted: {_named(found)}{hint}")
    return chosen


def _named(found: Sequence[Found]) -> str:
    """The names of the nearest cases there are, or that there are none."""
    return ", ".join(one.case.name for one in found[:_MOST_SHOWN] if one.case.name) or "none"
