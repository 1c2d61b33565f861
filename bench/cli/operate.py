"""The commands of `hil` for a running pair; what is heavy is imported by the command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import LIVE, RUNS, Commands, Force

RunOption = Annotated[
    Path | None,
    typer.Option(
        "--run", "--config",
        help="Which engine: the directory of its run, scenario.json or a .toml file."
        " Without it: the one that runs.",
    ),
]  # fmt: skip
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def status(
    *,
    watch: Annotated[bool, typer.Option("--watch", help="Go on until interrupted.")] = False,
    as_json: JsonOption = False,
    run: RunOption = None,
) -> None:
    """Show mode, TDC, lateness and counters of a running pair.

    Exit code 3: nobody is there.
    """
    from bench.live import status as work

    show = work.watch if watch else work.show
    raise typer.Exit(show(run, as_json=as_json))


def set_parameters(
    assignments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[KEY=VALUE...]", help="Or @FILE, a set that --save has written."),
    ] = None,
    *,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write all that is in force (.toml).")
    ] = None,
    force: Force = False,
    run: RunOption = None,
) -> None:
    """Change parameters of a running engine, all or none at one tick.

    Exit code 0: taken, with the tick from which it acts; 1: refused, with the reason.
    """
    from bench.live import steer

    raise typer.Exit(steer.change(assignments or [], save, run, force))


def get_parameters(
    keys: Annotated[
        list[str] | None,
        typer.Argument(metavar="[KEY...]", help="Keys, parts of them, or patterns; all without."),
    ] = None,
    *,
    as_json: JsonOption = False,
    run: RunOption = None,
) -> None:
    """Print the values that parameters of a running engine have."""
    from bench.live import steer

    raise typer.Exit(steer.tell_values(keys or [], run, as_json=as_json))


def start(*, run: RunOption = None) -> None:
    """Let a running controller start the engine."""
    from bench.live import steer

    raise typer.Exit(steer.order("start", run))


def stop(*, run: RunOption = None) -> None:
    """Let a running controller stop the engine."""
    from bench.live import steer

    raise typer.Exit(steer.order("stop", run))


PatternArgument = Annotated[
    str, typer.Argument(metavar="[PATTERN]", help="Part of a name, or one with * and ?.")
]


def parameters(
    pattern: PatternArgument = "",
    *,
    live: Annotated[
        bool, typer.Option("--live", help="Those that a running engine takes a change of.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """List the keys of the configuration: unit, default, range."""
    from bench.live import names

    raise typer.Exit(names.show_parameters(pattern, live=live, as_json=as_json))


def signals(pattern: PatternArgument = "", *, as_json: JsonOption = False) -> None:
    """List the fields of the logged topics: unit, rate, meaning."""
    from bench.live import names

    raise typer.Exit(names.show_signals(pattern, as_json=as_json))


def xcp(
    *,
    port: Annotated[
        int, typer.Option(min=0, max=65_535, help="TCP and UDP; 0: a free one.")
    ] = 5555,
    a2l: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the A2L file, and no more.")
    ] = None,
    force: Force = False,
    run: RunOption = None,
) -> None:
    """Serve a running engine to a calibration tool, over XCP.

    A slave on Ethernet, on this machine only.
    """
    if a2l is not None:
        from bench.live.xcp import a2l as description
        from hil.files import Output

        file = Output("--a2l", a2l, force)
        file.check(".a2l")
        file.write(description.text(port))
        raise typer.Exit(0)
    from bench.live.xcp import server

    raise typer.Exit(server.run(port, run))


def register(app: Commands) -> None:
    """Add the commands to `hil`."""
    for command in (status, start, stop):
        app.command(heading=LIVE)(command)
    app.command("get", heading=LIVE)(get_parameters)
    app.command("set", heading=LIVE)(set_parameters)
    app.command(heading=LIVE)(xcp)
    app.command(heading=RUNS)(parameters)
    app.command(heading=RUNS)(signals)
