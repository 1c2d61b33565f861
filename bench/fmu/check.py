"""What a unit is: the validator's findings, its variables of the contract, and one step of it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.fmu.trial import trial
from hil.errors import ConfigError, printable
from plant.engines.fmu.archive import Archive, library, open_archive
from plant.engines.fmu.binding import Bound
from plant.engines.fmu.contract import ALL
from plant.engines.fmu.unit import Unit


def check(file: Path, names: list[str]) -> int:
    """Print what was found; returns the exit code."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    library()
    archive = open_archive(file)
    problems = _problems(file)
    console.print(printable(_title(archive)))
    for problem in problems:
        console.print(f"validator: {printable(' '.join(problem.split()))}")
    if not problems:
        console.print("validator: no problem")
    try:
        unit = Unit(archive, _map(names), {})
    except ConfigError as error:
        console.print(f"as plant: {error}")
        return 1
    console.print(_variables(unit))
    reason = trial(file, _map(names))
    if reason:
        console.print(f"as plant: {printable(reason)}")
        return 1
    console.print(f"as plant: {'; '.join(_abilities(unit))}; loaded and stepped once")
    return 1 if problems else 0


def _problems(file: Path) -> list[str]:
    """Return what FMPy's validator finds, or what it fails at."""
    try:
        found: list[str] = import_module("fmpy.validation").validate_fmu(str(file))
    except Exception as error:  # whatever it meets in a file that it does not expect
        return [str(error).partition("\n")[0] or type(error).__name__]
    return found


def _title(archive: Archive) -> str:
    d = archive.description
    tool = f", made by {d.generationTool}" if d.generationTool else ""
    return f"{archive.path}: {d.modelName}, FMI {d.fmiVersion}, co-simulation{tool}"


def _map(names: list[str]) -> dict[str, str]:
    pairs = [text.partition("=") for text in names]
    for name, equals, own in pairs:
        if not (name and equals and own):
            raise ConfigError(f"--name {name}{equals}{own}: accepted is OURS=ITS, as in x_m=piston")
    return {name: own for name, _, own in pairs}


def _variables(unit: Unit) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("contract", "causality", "unit", "its variable", "factor"):
        table.add_column(title)
    for variable in ALL:
        bound: Bound | None = unit.bound.get(variable.name)
        own = "-" if bound is None else bound.name
        factor = "" if bound is None or bound.factor == 1.0 else f"{bound.factor:g}"
        table.add_row(variable.name, variable.causality, variable.unit, own, factor)
    return table


def _abilities(unit: Unit) -> list[str]:
    return [
        "begins settled or at rest" if unit.begins_settled else "begins at rest only",
        "disturbances inside a tick" if unit.splits else "disturbances at ticks only",
        "snapshots" if unit.restores else "no snapshots: replay from the start only",
    ]
