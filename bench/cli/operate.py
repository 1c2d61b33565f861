"""The commands of `hil` for a running pair; what is heavy is imported by the command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        help="Scenario of the pair: a .toml file, scenario.json or the directory of a run."
        " Without it: the default endpoints.",
    ),
]


def status(
    *,
    watch: Annotated[bool, typer.Option("--watch", help="Go on until interrupted.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    config: ConfigOption = None,
) -> None:
    """Show mode, TDC, lateness and counters of a running pair.

    Exit code 3: nobody is there.
    """
    from bench.live import status as work

    show = work.watch if watch else work.show
    raise typer.Exit(show(config, as_json=as_json))


def set_points(
    assignments: Annotated[
        list[str], typer.Argument(metavar="KEY=VALUE...", help="As in tdc_ref_m=0.0152.")
    ],
    *,
    config: ConfigOption = None,
) -> None:
    """Change set points of a running controller: tdc_ref_m, target_power_w, law."""
    from bench.live import status as work

    raise typer.Exit(work.set_points(assignments, config))


def start(*, config: ConfigOption = None) -> None:
    """Let a running controller start the engine."""
    from bench.live import status as work

    raise typer.Exit(work.order("start", config))


def stop(*, config: ConfigOption = None) -> None:
    """Let a running controller stop the engine."""
    from bench.live import status as work

    raise typer.Exit(work.order("stop", config))


PatternArgument = Annotated[
    str, typer.Argument(metavar="[PATTERN]", help="Part of a name, or one with * and ?.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def parameters(
    pattern: PatternArgument = "",
    *,
    live: Annotated[
        bool, typer.Option("--live", help="Those that a running engine takes a change of.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """List the parameters: every key of the configuration with unit, default and range."""
    from bench.live import names

    raise typer.Exit(names.show_parameters(pattern, live=live, as_json=as_json))


def signals(pattern: PatternArgument = "", *, as_json: JsonOption = False) -> None:
    """List the signals: every field of a logged topic with unit and rate."""
    from bench.live import names

    raise typer.Exit(names.show_signals(pattern, as_json=as_json))


def register(app: typer.Typer) -> None:
    """Add the commands to `hil`."""
    app.command()(status)
    app.command("set")(set_points)
    app.command()(start)
    app.command()(stop)
    app.command()(parameters)
    app.command()(signals)
