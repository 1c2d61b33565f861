"""`hil new`: arguments only."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from bench.cli.options import Force

Kind = Literal["law", "engine", "scenario", "suite"]


def new(
    kind: Annotated[Kind, typer.Argument(help="What is begun.")],
    name: Annotated[str, typer.Argument(help="Its name, as in my-law.")],
    *,
    force: Force = False,
) -> None:
    """Write a file to begin from: a law, an engine, a scenario or a suite of one's own."""
    from bench.own.beginning import write

    path = write(kind, name, force=force)
    typer.echo(f"{path}: how to try it stands at its top")


def register(app: typer.Typer) -> None:
    """Add the command to `hil`."""
    app.command()(new)
