"""`hil compare`, `tune`, `campaign`, `atlas`: arguments only; what is heavy is imported later."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import STUDIES, Assignments, Commands, Force

StepArgument = Annotated[str, typer.Argument(help="A scenario with one load step.")]
LawsOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAMES", help="Laws, separated by commas, of: {laws}; all that control without it."
    ),
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
    model: Annotated[
        str | None, typer.Option(metavar="NAME", help="Engine model: {models}.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Directory of table and pictures.")] = None,
    quick: Quick = False,
    everything: Everything = False,
    json: Json = None,
    workers: Workers = 2,
    force: Force = False,
    assignments: Assignments = None,
) -> None:
    """Run several laws on the same load steps, beside the bound.

    Writes a table and pictures; the bound is what no law can go below.
    """
    from bench.studies import compare_command as work

    given = assignments or []
    if not (quick or everything):
        if json is not None:
            raise typer.BadParameter("accepted with --quick or --all", param_hint="--json")
        raise typer.Exit(work.run(scenario, controllers, model, out, given, force=force))
    wanted = work.Survey(controllers, model, out, tuple(given), everything, json, workers, force)
    raise typer.Exit(work.run_survey(wanted))


def tune(
    law: Annotated[
        str, typer.Argument(help="Law whose gains are looked for: {tunable}, or a .py file.")
    ],
    *,
    search: Annotated[bool, typer.Option("--search", help="Look for better gains.")] = False,
    generations: Annotated[int, typer.Option(min=1, max=1000, help="Of the search.")] = 20,
    start: Annotated[
        str | None, typer.Option("--from", help="Gains to start from, separated by commas.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Scenario file to write, gains and provenance in it.")
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES", help="Models to judge on, in place of both linear ones: {models}."
        ),
    ] = None,
    prototype: Annotated[
        str, typer.Option(metavar="NAME", help="Engine: {prototypes}, or a .toml file.")
    ] = "nu",
    rate: Annotated[str, typer.Option(metavar="HZ,HZ", help="Loop rates.")] = "1000",
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes.")] = 2,
    force: Force = False,
) -> None:
    """Judge the gains of a law, or look for better ones.

    Over load steps, and with another engine than is believed.
    """
    from bench.studies import tune as work
    from bench.studies.trial import read_trial

    trial = read_trial(model, rate, prototype)
    sought = generations if search else 0
    raise typer.Exit(work.run(work.Wanted(law, trial, sought, start, out, force, workers)))


def performance_map(
    scenario: Annotated[str, typer.Argument(help="A scenario that begins settled.")] = "steady",
    *,
    model: Annotated[
        str | None, typer.Option(metavar="NAME", help="Engine model: {models}.")
    ] = None,
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
    """Measure what an engine delivers, as a map for target powers.

    At several dead centres and loads.
    """
    from bench.run.commands import overrides
    from bench.studies import performance as work

    changes = overrides({"plant.model": model}, assignments or [])
    raise typer.Exit(work.run(scenario, tdc, out, changes, force=force))


def campaign(
    file: Annotated[str, typer.Argument(help="Campaign: {campaigns}, or a .toml file.")],
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
    """Run thousands of seeded variations on all cores; resumable."""
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
    """Make the figures of the thesis again, judge its printed numbers.

    Writes index.html, a page a chapter and atlas.json. Exit code 1: a deviation has no reason told.
    """
    from bench.studies.atlas import command as work

    raise typer.Exit(work.run(names or [], out, quick=quick))


def register(app: Commands) -> None:
    """Add the commands to `hil`."""
    for command in (compare, tune, campaign, atlas):
        app.command(heading=STUDIES)(command)
    app.command("map", heading=STUDIES)(performance_map)
