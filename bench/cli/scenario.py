"""`hil scenario`: what is asked of a scenario without running it for its verdict."""

from __future__ import annotations

from typing import Annotated

import typer

from bench.cli.options import RUNS, Assignments, Commands

app = Commands("scenario", "Look into scenarios.")


@app.command()
def prove(
    scenario: Annotated[
        list[str], typer.Argument(metavar="SCENARIO", help="Names, .toml files or FILE::CASE.")
    ],
    *,
    assignments: Assignments = None,
) -> None:
    """Put faults into controller and plant until every expectation has failed once.

    Exit code 1: no fault breaks some of them, which are named; or one is not met without any.
    """
    from bench.run.commands import overrides
    from bench.suite.prove import run

    raise typer.Exit(run(scenario, overrides({}, assignments or [])))


def register(root: typer.Typer) -> None:
    """Add the commands to `hil`."""
    root.add_typer(app, rich_help_panel=RUNS)
