"""`hil panel`, `hil view`, `hil foxglove`: what is heavy is imported by the command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.operate import RunOption
from bench.cli.options import LIVE, RUNS, Commands

PortOption = Annotated[
    int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0: any that is free.")
]
BrowserOption = Annotated[
    bool, typer.Option("--no-browser", help="Open no browser; the address is printed anyway.")
]


def panel(
    *,
    run: Annotated[
        Path | None,
        typer.Option(
            "--run",
            metavar="DIR",
            help="Directory of a run, or the file of a scenario"
            " in which nothing is open; else the one that runs.",
        ),
    ] = None,
    port: PortOption = 0,
    no_browser: BrowserOption = False,
) -> None:
    """Watch and steer a running engine in a browser.

    Prints the page's address, with the token that opens it.
    """
    from bench.panel import command

    raise typer.Exit(command.run(run, port, browser=not no_browser))


def view(
    directory: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run: its directory, or a file in it.")
    ],
    *,
    port: PortOption = 0,
    no_browser: BrowserOption = False,
) -> None:
    """Look at a report with its logs: a zoom shows every sample."""
    from bench.panel import view as work

    raise typer.Exit(work.run(directory, port, browser=not no_browser))


def foxglove(
    *,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0: any that is free.")
    ] = 8765,
    run: RunOption = None,
) -> None:
    """Serve a running engine to Foxglove, Lichtblick or PlotJuggler.

    Prints the address.
    """
    from bench.live.foxglove import server

    raise typer.Exit(server.run(port, run))


def register(app: Commands) -> None:
    """Add the commands to `hil`."""
    app.command(heading=LIVE)(panel)
    app.command(heading=RUNS)(view)
    app.command(heading=LIVE)(foxglove)
