"""From one scenario file to many scenarios: files it includes, and cases it is run in.

include = ["load-decrease", "common.toml"]   others, in their order; this file's keys count last
table = "cases.csv"                          a case a row: its name, then a key a column
seeds = 5                                    each case with so many seeds, or those of a list
[cases.light]                                a case: keys of the scenario with its values
[vary]                                       every combination of values of some keys
"""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from hil.errors import ConfigError
from hil.files import read_regular
from hil.toml import Tree, parse_toml, read_toml

KEYS: Final = ("include", "cases", "vary", "table", "seeds")
"""Keys at the top of a scenario file that make scenarios; none of them is in a scenario."""

MOST: Final = 10_000
_DEEPEST: Final = 16
_RANGE: Final = {"from", "to", "count", "step"}

Locate = Callable[[str], Path]
Overlay = tuple[str, Tree]
"""Part of a case's name, and the keys that it changes."""


class Case(NamedTuple):
    """One scenario of a file; `name` is empty where the file has only one."""

    name: str
    tree: Tree


def read_composed(path: Path, locate: Locate, depth: int = 0) -> Tree:
    """Read a scenario file with all that it includes.

    Parameters: locate : finds what is included and no file beside it, by name

    Raises: ConfigError when a file is missing, empty, or includes itself
    """
    if depth > _DEEPEST:
        raise ConfigError(f"{path}: include: nested too deep: does a file include itself?")
    own = anchored(read_toml(path), path)
    if not own:
        raise ConfigError(f'{path}: empty; accepted is one key at least, as in name = "steady"')
    tree: Tree = {}
    for name in _strings(own.pop("include", []), path, "include"):
        beside = path.parent / name
        tree = merged(
            tree, read_composed(beside if beside.is_file() else locate(name), locate, depth + 1)
        )
    return merged(tree, own)


def merged(tree: Mapping[str, Any], over: Mapping[str, Any]) -> Tree:
    """Return a tree with the keys of another one, tables in tables; dotted keys are paths."""
    result = dict(tree)
    for key, value in over.items():
        head, _, rest = key.partition(".")
        changed = {rest: value} if rest else value
        below = result.get(head)
        if isinstance(changed, Mapping):
            result[head] = merged(below if isinstance(below, Mapping) else {}, changed)
        else:
            result[head] = changed
    return result


def cases_of(tree: Tree, path: Path) -> list[Case]:
    """Return every scenario of a composed file, by what makes scenarios, in its order.

    Raises: ConfigError naming the key that is wrong
    """
    base = {key: value for key, value in tree.items() if key not in KEYS}
    choices = [
        choice
        for choice in (_named(tree, path), *_varied(tree, path), _seeded(tree, path))
        if choice
    ]
    found = [_case(base, overlays) for overlays in itertools.product(*choices)]
    if len(found) > MOST:
        raise ConfigError(f"{path}: {len(found)} cases; accepted are {MOST}")
    return found


def table_cases(path: Path, locate: Locate) -> list[Case]:
    """Return the cases of a table by itself, each of the scenario in its column `scenario`.

    Raises: ConfigError naming the row that is wrong
    """
    found = []
    for name, row in _rows(path):
        given = dict(row)
        scenario = given.pop("scenario", None)
        if not isinstance(scenario, str):
            raise ConfigError(f"{path}: row {name!r}: needs a scenario, by name or file")
        beside = path.parent / scenario
        base = read_composed(beside if beside.is_file() else locate(scenario), locate)
        if set(base) & set(KEYS):
            raise ConfigError(f"{path}: row {name!r}: {scenario} has cases of its own")
        found.append(Case(name, merged(base, given)))
    return found


def _case(base: Tree, overlays: Sequence[Overlay]) -> Case:
    tree = base
    for _, overlay in overlays:
        tree = merged(tree, overlay)
    return Case("-".join(name for name, _ in overlays), tree)


def anchored(tree: Tree, path: Path) -> Tree:
    """Return the tree of a file; other files that it names by relative paths are beside it."""
    for table, key in (("expect", "recorded"), ("events", "file")):
        entries = tree.get(table)
        if isinstance(entries, dict):
            placed = {name: _anchored_entry(entry, key, path) for name, entry in entries.items()}
            tree = tree | {table: placed}
    if isinstance(tree.get("table"), str):
        tree = tree | {"table": str(path.parent / tree["table"])}
    return tree


def _anchored_entry(entry: Any, key: str, path: Path) -> Any:  # noqa: ANN401
    given = entry.get(key) if isinstance(entry, dict) else None
    if not isinstance(given, str) or Path(given).is_absolute():
        return entry
    return entry | {key: str((path.parent / given).resolve())}


def _named(tree: Tree, path: Path) -> list[Overlay]:
    """The cases that have names: of the tables [cases.NAME], and of the rows of a table."""
    given = tree.get("cases", {})
    if not isinstance(given, dict) or not all(isinstance(case, dict) for case in given.values()):
        raise ConfigError(f"{path}: cases: accepted are tables [cases.NAME] of a scenario's keys")
    found = list(given.items())
    table = tree.get("table")
    if table is not None and not isinstance(table, str):
        raise ConfigError(f"{path}: table: accepted is the name of a .csv file")
    return found + (list(_rows(Path(table))) if table else [])


def _rows(path: Path) -> Iterator[Overlay]:
    """The cases of a CSV file: the first column is the name, the others are keys."""
    text = read_regular(path).decode("utf-8-sig")
    rows = [row for row in csv.reader(io.StringIO(text)) if row and not row[0].startswith("#")]
    if len(rows) < 2 or len(rows[0]) < 2:
        raise ConfigError(f"{path}: accepted is a head of `name` and keys, and a row a case")
    _, *keys = rows[0]
    for number, (name, *values) in enumerate(rows[1:], 2):
        if len(values) != len(keys):
            raise ConfigError(
                f"{path}: row {number} has {len(values) + 1} columns, not {len(keys) + 1}"
            )
        yield (
            name,
            {key.strip(): _value(v) for key, v in zip(keys, values, strict=True) if v.strip()},
        )


def _value(text: str) -> Any:  # noqa: ANN401
    """A value as TOML would read it; what is none is a text."""
    try:
        return parse_toml(f"value = {text.strip()}")["value"]
    except ValueError:
        return text.strip()


def _varied(tree: Tree, path: Path) -> Iterator[list[Overlay]]:
    """The values of each key of [vary]."""
    given = tree.get("vary", {})
    if not isinstance(given, dict):
        raise ConfigError(f"{path}: vary: accepted is a table of keys with their values")
    for key, values in _leaves(given):
        label = key.rpartition(".")[2]
        found = values if isinstance(values, list) else _range(values, f"{path}: vary.{key}")
        if not found:
            raise ConfigError(f"{path}: vary.{key}: accepted is one value at least")
        yield [(f"{label}={_shown(value)}", {key: value}) for value in found]


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping) and not set(value) <= _RANGE:
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _range(given: Any, where: str) -> list[Any]:  # noqa: ANN401
    """Values from one to another, so many or so far apart, both ends included."""
    accepted = f"{where}: accepted is a list, or from, to and one of count (2 to {MOST}) and step"
    if not isinstance(given, Mapping) or not {"from", "to"} <= set(given) or len(given) != 3:
        raise ConfigError(accepted)
    if any(isinstance(v, bool) or not isinstance(v, int | float) for v in given.values()):
        raise ConfigError(accepted)
    first, last, step = given["from"], given["to"], given.get("step")
    count = given.get("count") if step is None else _count(first, last, step)
    if not isinstance(count, int) or not 2 <= count <= MOST:
        raise ConfigError(accepted)
    if step is not None:
        return [first + number * step for number in range(count)]
    return [first + (last - first) * number / (count - 1) for number in range(count)]


def _count(first: float, last: float, step: float) -> int:
    return int((last - first) / step + 1e-9) + 1 if step and (last - first) / step > 0.0 else 0


def _seeded(tree: Tree, path: Path) -> list[Overlay]:
    """The seeds that each case is run with."""
    given = tree.get("seeds")
    if given is None:
        return []
    seeds = list(range(1, given + 1)) if type(given) is int else given
    if not isinstance(seeds, list) or not seeds or not all(type(seed) is int for seed in seeds):
        raise ConfigError(f"{path}: seeds: accepted is a whole number above 0, or a list of some")
    return [(f"seed={seed}", {"run": {"seed": seed}}) for seed in seeds]


def _strings(given: Any, path: Path, key: str) -> list[str]:  # noqa: ANN401
    named = [given] if isinstance(given, str) else given
    if not isinstance(named, list) or not all(isinstance(name, str) for name in named):
        raise ConfigError(f"{path}: {key}: accepted is a list of names or files")
    return named


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
