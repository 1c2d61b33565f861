"""The commands of `hil` about logs; what is heavy is imported by the command that needs it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from bench.cli.options import LOGS, MACHINE, Assignments, Commands, Force

LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help="An .mcap file of a run.")]
Seconds = Annotated[float | None, typer.Option(help="Instant since the start of the run [s].")]
LawOption = Annotated[
    Path | None,
    typer.Option("--controller", metavar="FILE", help="The law, where the run was of one's own."),
]
EngineOption = Annotated[
    Path | None,
    typer.Option("--model", metavar="FILE", help="The engine, where the run was of one's own."),
]
Format = Literal["parquet", "csv", "mf4"]


def replay(
    log: LogArgument,
    *,
    start: Annotated[
        float | None, typer.Option("--from", help="Begin at the snapshot before this time [s].")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", help="End at this time [s].")] = None,
    config: Annotated[
        Path | None, typer.Option(help="Scenario to use for a log that carries none.")
    ] = None,
    controller: LawOption = None,
    model: EngineOption = None,
) -> None:
    """Feed a log to the loops as they are today, compare what they do.

    Exit code 0: identical; 1: not; 2: a file that cannot be used.
    """
    from bench.logs import commands

    raise typer.Exit(commands.replay(log, config, start, end, controller, model))


def diff(
    first: Annotated[Path, typer.Argument(metavar="A")],
    second: Annotated[Path, typer.Argument(metavar="B")],
    *,
    timing: Annotated[bool, typer.Option("--timing", help="Compare when ticks ran, too.")] = False,
) -> None:
    """Compare two logs and explain where they part.

    Exit code 0: the same; 1: not; 2: a file that cannot be used.
    """
    from bench.logs import commands

    raise typer.Exit(commands.diff(first, second, timing=timing))


def what_if(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="Directory of a run.")],
    *,
    start: Annotated[str, typer.Option("--from", help="Instant, as in 1.05s or tick:1050.")],
    assignments: Assignments = None,
    duration: Annotated[float | None, typer.Option(help="End of the continued run [s].")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory of logs and picture.")] = None,
    controller: LawOption = None,
    model: EngineOption = None,
) -> None:
    """Continue a run from an instant with other parameters; draw both."""
    from bench.logs import commands

    raise typer.Exit(
        commands.what_if(directory, start, assignments or [], duration, out, controller, model)
    )


def info(
    log: LogArgument,
    *,
    verify: Annotated[
        bool, typer.Option("--verify", help="Read everything and check every checksum.")
    ] = False,
) -> None:
    """Tell what a log holds, of which run, and whether it is whole."""
    from bench.logs import commands

    raise typer.Exit(commands.info(log, verify=verify))


def export(
    log: LogArgument,
    *,
    to: Annotated[Format, typer.Option("--to", help="Kind of file.")] = "parquet",
    out: Annotated[Path | None, typer.Option(help="Directory, or file for mf4.")] = None,
    topic: Annotated[
        list[str] | None, typer.Option(help="Only this topic; may be repeated.")
    ] = None,
    start: Annotated[float | None, typer.Option("--from", help="From this time on [s].")] = None,
    end: Annotated[float | None, typer.Option("--until", help="Up to this time [s].")] = None,
    force: Force = False,
) -> None:
    """Write a log as Parquet, CSV or MF4: for pandas, MATLAB, ASAM.

    What cannot be decoded is left out and told.
    """
    from bench.logs import commands

    raise typer.Exit(commands.export(log, to, out, topic or [], start, end, force=force))


def repair(
    log: LogArgument,
    *,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="By default LOG with .repaired.mcap.")
    ] = None,
    force: Force = False,
) -> None:
    """Save what is whole in a damaged log, proved by reading it back."""
    from bench.logs import commands

    raise typer.Exit(commands.repair(log, out, force=force))


def golden(
    *,
    update: Annotated[bool, typer.Option("--update", help="Record the golden runs anew.")] = False,
    directory: Annotated[Path, typer.Option(help="Where the golden runs are.")] = Path(
        "tests/golden"
    ),
) -> None:
    """Replay the golden runs, or record them anew.

    With --update what changed is printed.
    """
    from bench.dev import golden as runs

    raise typer.Exit(runs.update(directory) if update else runs.check(directory))


def register(app: Commands) -> None:
    """Add the commands to `hil`."""
    for command in (info, replay, diff, export, repair):
        app.command(heading=LOGS)(command)
    app.command("what-if", heading=LOGS)(what_if)
    app.command(heading=MACHINE)(golden)
