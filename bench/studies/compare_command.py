"""`hil compare`: compare, then tell and draw what was found."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from bench.studies.compare import compare, laws_of
from bench.studies.compare_page import table, write_page
from hil.config.load import parse_assignment


def run(
    name: str, controllers: str | None, model: str | None, out: Path | None, assignments: list[str]
) -> int:
    """Compare, print the table, write it with the pictures; returns the exit code.

    Raises: ConfigError
    """
    changes = [parse_assignment(text) for text in assignments]
    if model is not None:
        changes.append(("plant.model", model))
    found = compare(name, laws_of(controllers), changes)
    text = table(found)
    directory = out or Path("runs") / f"compare-{found.scenario.name}"
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "table.md").write_text(text, encoding="utf-8")
    console = Console(highlight=False)
    console.print(text, markup=False, soft_wrap=True)
    write_page(found, directory / "compare.html")
    console.print(f"{directory / 'compare.html'}", markup=False)
    return 0
