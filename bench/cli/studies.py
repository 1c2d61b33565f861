"""`hil compare`, `tune`, `campaign`, `atlas`: arguments only; what is heavy is imported later."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Assignments, Force

StepArgument = Annotated[str, typer.Argument(help="A scenario with one load step.")]
LawsOption = Annotated[
    str | None,
    typer.Option(help="Laws to compare, separated by commas; without it all that control."),
]
Quick = Annotated[
    bool, typer.Option("--quick", help="Every engine at 1 kHz, load steps and noise: a table.")
]
Everything = Annotated[
    bool, typer.Option("--all", help="The same at every rate, 500 to 20,000 Hz.")
]
Json = Annotated[Path | None, typer.Option(help="JSON file of that table, with --quick or --all.")]
Workers = Annotated[int, typer.Option(min=1, max=64, help="Processes of that table.")]


def compare(
    scenario: StepArgument = "load-decrease",
    *,
    controllers: LawsOption = None,
    model: Annotated[str | None, typer.Option(help="Engine model of the plant.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory of table and pictures.")] = None,
    quick: Quick = False,
    everything: Everything = False,
    json: Json = None,
    workers: Workers = 2,
    force: Force = False,
    assignments: Assignments = None,
) -> None:
    """Run several laws on the same load steps, and draw them beside the physical bound."""
    from bench.studies import compare_command as work

    given = assignments or []
    if not (quick or everything):
        if json is not None:
            raise typer.BadParameter("accepted with --quick or --all", param_hint="--json")
        raise typer.Exit(work.run(scenario, controllers, model, out, given, force=force))
    wanted = work.Survey(controllers, model, out, tuple(given), everything, json, workers, force)
    raise typer.Exit(work.run_survey(wanted))


def tune(
    law: Annotated[str, typer.Argument(help="Law whose gains are looked for.")],
    *,
    search: Annotated[bool, typer.Option("--search", help="Look for better gains.")] = False,
    generations: Annotated[int, typer.Option(min=1, max=1000, help="Of the search.")] = 20,
    start: Annotated[
        str | None, typer.Option("--from", help="Gains to start from, separated by commas.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Scenario file to write, gains and provenance in it.")
    ] = None,
    force: Force = False,
) -> None:
    """Judge the gains of a law over load steps and model errors, or look for better ones."""
    from bench.studies import tune as work

    raise typer.Exit(
        work.run(law, search=search, generations=generations, start=start, out=out, force=force)
    )


def performance_map(
    scenario: Annotated[str, typer.Argument(help="A scenario that begins settled.")] = "steady",
    *,
    model: Annotated[str | None, typer.Option(help="Engine model of the plant.")] = None,
    tdc: Annotated[
        str | None,
        typer.Option(metavar="MM,MM", help="Dead centres; without it the set point and 1 mm."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Scenario file to write, the map and its origin in it.")
    ] = None,
    force: Force = False,
    assignments: Assignments = None,
) -> None:
    """Measure what an engine delivers at which dead centre and load, as a map for target powers."""
    from bench.run.commands import overrides
    from bench.studies import performance as work

    changes = overrides({"plant.model": model}, assignments or [])
    raise typer.Exit(work.run(scenario, tdc, out, changes, force=force))


def campaign(
    file: Annotated[str, typer.Argument(help="Campaign: a name or a path to a .toml file.")],
    *,
    out: Annotated[Path | None, typer.Option(help="Directory; an unfinished one goes on.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="A Dask cluster.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=1024, help="Local processes.")] = 2,
    runs: Annotated[int | None, typer.Option(min=1, help="Fewer or more runs.")] = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="K/N", help="Only what machine K of N has to run."),
    ] = None,
) -> None:
    """Run thousands of seeded variations on all cores or a cluster; resumable."""
    from bench.studies.campaign import command as work

    raise typer.Exit(work.run(file, out, scheduler, workers, runs, shard))


def atlas(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CHAPTER|FIGURE]...", help="As 4, A1, F4.15, T4.3; none for all."),
    ] = None,
    *,
    out: Annotated[Path | None, typer.Option(help="Directory; an unfinished one goes on.")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A short form of what takes long.")
    ] = False,
) -> None:
    """Make every figure and table of the thesis again, and judge every printed number.

    Writes index.html, a page a chapter and atlas.json. Exit code 1: a deviation has no reason told.
    """
    from bench.studies.atlas import command as work

    raise typer.Exit(work.run(names or [], out, quick=quick))


def register(app: typer.Typer) -> None:
    """Add the commands to `hil`."""
    for command in (compare, tune, campaign, atlas):
        app.command()(command)
    app.command("map")(performance_map)
