"""`hil compare`: compare, then tell and draw what was found."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from bench.run import directory as outdir
from bench.run import scenarios
from bench.studies.compare import compare, laws_of
from bench.studies.compare_page import table, write_page
from hil.config.load import parse_assignment


def run(
    name: str, controllers: str | None, model: str | None, out: Path | None,
    assignments: list[str], *, force: bool = False,
) -> int:  # fmt: skip
    """Compare, print the table, write it with the pictures; returns the exit code.

    Raises: ConfigError
    """
    changes = [parse_assignment(text) for text in assignments]
    if model is not None:
        changes.append(("plant.model", model))
    laws = laws_of(controllers)
    directory = out or outdir.fresh(f"compare-{scenarios.read(name, changes).name}")
    page, listed = outdir.claim("--out", directory, ("compare.html", "table.md"), force=force)
    found = compare(name, laws, changes)
    text = table(found)
    listed.write(text)
    console = Console(highlight=False)
    console.print(text, markup=False, soft_wrap=True)
    write_page(found, page)
    console.print(f"{page.path}", markup=False)
    return 0
