"""`hil new`: arguments only."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from bench.cli.options import RUNS, Commands, Force

Kind = Literal["law", "engine", "prototype", "scenario", "suite"]


def new(
    kind: Annotated[Kind, typer.Argument(help="What is begun.")],
    name: Annotated[str, typer.Argument(help="Its name, as in my-law.")],
    *,
    force: Force = False,
) -> None:
    """Write a law, engine, prototype, scenario or suite to begin from."""
    from bench.own.beginning import write

    path = write(kind, name, force=force)
    typer.echo(f"{path}: how to try it stands at its top")


def register(app: Commands) -> None:
    """Add the command to `hil`."""
    app.command(heading=RUNS)(new)
