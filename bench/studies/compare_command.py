"""`hil compare`: compare, then tell and draw what was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from bench.progress import progress
from bench.run import directory as outdir
from bench.run import scenarios
from bench.studies import survey, survey_page
from bench.studies.compare import compare, count_of, laws_of
from bench.studies.compare_page import table, told, write_page
from controller.motion.laws import LAWS
from hil.errors import ConfigError
from hil.files import Output
from hil.toml import parse_assignment

FILES = ("compare.html", "table.md")


def run(
    name: str, controllers: str | None, model: str | None, out: Path | None,
    assignments: list[str], *, force: bool = False,
) -> int:  # fmt: skip
    """Compare on one engine, print the table, write it with the pictures.

    Returns: the exit code
    Raises: ConfigError
    """
    changes = [parse_assignment(text) for text in assignments]
    if model is not None:
        changes.append(("plant.model", model))
    laws, scenario = laws_of(controllers), scenarios.read(name, changes)
    directory = out or outdir.fresh(f"compare-{scenario.name}")
    page, listed = outdir.claim("--out", directory, FILES, force=force)
    with progress("compare", count_of(laws), "runs") as advance:
        found = compare(name, laws, changes, advance)
    listed.write(table(found))
    console = Console(highlight=False)
    console.print(told(found), markup=False, soft_wrap=True)
    write_page(found, page)
    console.print(f"{page.path}", markup=False)
    return 0


class Survey(NamedTuple):
    """What is asked for; `whole`: at every rate and more moments, else at 1 kHz."""

    controllers: str | None
    model: str | None
    out: Path | None
    assignments: tuple[str, ...]
    whole: bool
    json: Path | None
    workers: int
    force: bool


def run_survey(wanted: Survey) -> int:
    """Compare on every engine, print the table; write JSON and page where they are asked for.

    Returns: the exit code
    Raises: ConfigError
    """
    controllers, model, out, assignments, whole, json, workers, force = wanted
    extent = survey.WHOLE if whole else survey.QUICK
    laws = laws_of(controllers) if controllers else tuple(LAWS)
    engines = [engine for engine in survey.ENGINES if model in (None, engine.model)]
    if not engines:
        known = ", ".join(dict.fromkeys(engine.model for engine in survey.ENGINES))
        raise ConfigError(f"--model {model}: a comparison of all engines has {known}")
    changes: list[tuple[str, Any]] = [parse_assignment(text) for text in assignments]
    survey.check_changes(engines, changes)
    file = None if json is None else Output("--json", json, force)
    if file is not None:
        file.check(".json")
    files = None if out is None else outdir.claim("--out", out, FILES, force=force)
    tasks = survey.tasks(laws, engines, extent, changes)
    finished: list[survey.Row] = []
    try:
        with progress("compare", len(tasks), "rows") as advance:

            def told_of(row: survey.Row) -> None:
                finished.append(row)
                advance(1)

            survey.survey(tasks, workers, told_of)
    finally:  # of an interrupted one what there is
        if finished:
            _tell(survey.in_order(finished), file, files)
    return 0


def _tell(
    rows: list[survey.Row], file: Output | None, files: Sequence[Output] | None
) -> None:  # fmt: skip
    """Print and write the rows that are finished."""
    Console(highlight=False).print(survey_page.told(rows), markup=False, soft_wrap=True)
    if file is not None:
        file.write(survey_page.as_json(rows))
    if files is not None:
        page, listed = files
        listed.write(survey_page.table(rows))
        survey_page.write_page(rows, page)
