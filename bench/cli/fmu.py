"""`hil fmu`: Functional Mock-up Units, ours to export and others to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, get_args

import typer

from bench.cli.options import MACHINE, Commands, Force

app = Commands("fmu", "Functional Mock-up Units: export ours, look at others.")

ModelName = Literal[
    "closed-form", "harmonic", "rectangular", "nonlinear", "two-stroke", "four-stroke", "starting"
]
Prototype = Literal["nu", "bit"]


@app.command()
def export(
    out: Annotated[Path, typer.Argument(help="File to write, as engine.fmu.")],
    *,
    model: Annotated[
        ModelName,
        typer.Option(metavar="NAME", help=f"Engine model: {', '.join(get_args(ModelName))}."),
    ] = "harmonic",
    prototype: Annotated[
        Prototype | None, typer.Option(help="Engine; nu, but bit for starting.")
    ] = None,
    fmi: Annotated[Literal["2", "3"], typer.Option(help="Version of the standard.")] = "3",
    force: Force = False,
) -> None:
    """Write an engine model as a unit for co-simulation: a binary of this machine and its sources.

    Needs the extra `fmu` and a C compiler, and `detailed` for a detailed engine; the unit itself
    needs none of them.
    """
    from bench.fmu.export import export as write
    from hil.config.prototypes import engine_with

    made = write(out, model, prototype or engine_with(model), int(fmi), force=force)
    print(f"{made.path}: FMI {fmi}.0, {made.platform}, {made.variables} variables")


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="A unit.")],
    *,
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="OURS=ITS", help="Its name for a variable of the contract."),
    ] = None,
) -> None:
    """Validate a unit and tell whether it can be the plant; exit code 1 when it cannot."""
    from bench.fmu.check import check as look

    raise typer.Exit(look(file, names or []))


def register(root: typer.Typer) -> None:
    """Put the commands under `hil fmu`."""
    root.add_typer(app, rich_help_panel=MACHINE)
