"""`hil bench`: what this machine can hold; what is heavy is imported by the command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from bench.cli.options import MACHINE, Commands, Force

Model = Literal["closed-form", "harmonic", "rectangular", "nonlinear"]
LinkChoice = Literal["zenoh", "shm"]
OutOption = Annotated[
    Path | None, typer.Option(help="Directory of latency.json and pictures; none: print only.")
]
ModelOption = Annotated[Model, typer.Option(help="Engine model of the plant.")]
LawOption = Annotated[str, typer.Option(metavar="NAME", help="Law: {laws}.")]
LinkOption = Annotated[LinkChoice, typer.Option(help="How plant and controller are joined.")]

app = Commands("bench", "Measure what this machine can hold.")


@app.command()
def latency(
    *,
    link: LinkOption = "zenoh",
    rate: Annotated[int, typer.Option(min=50, max=20_000, help="Ticks a second.")] = 1000,
    rounds: Annotated[int, typer.Option(min=1, max=100, help="Turns of all in order.")] = 4,
    seconds: Annotated[float, typer.Option(min=0.5, max=600.0, help="Of each turn [s].")] = 5.0,
    out: OutOption = None,
    force: Force = False,
) -> None:
    """Measure loop, cyclictest and a bare ping-pong in turns, and compare them."""
    from bench.measure.latency import Plan, run

    raise typer.Exit(run(Plan(link, rate, rounds, seconds), out, force=force))


@app.command()
def rate(
    *,
    link: LinkOption = "zenoh",
    lowest: Annotated[int, typer.Option(min=50, max=20_000)] = 500,
    highest: Annotated[int, typer.Option(min=50, max=20_000)] = 20_000,
    seconds: Annotated[float, typer.Option(min=0.5, max=600.0, help="Of each trial [s].")] = 10.0,
    out: OutOption = None,
    force: Force = False,
) -> None:
    """Find the highest rate with at most 1 in 10 000 deadlines missed."""
    from bench.measure.highest_rate import run

    raise typer.Exit(run(link, (lowest, highest), seconds, out, force=force))


@app.command()
def step(
    *,
    ticks: Annotated[int, typer.Option(min=100, max=1_000_000)] = 5000,
    model: ModelOption = "harmonic",
    controller: LawOption = "cascade",
    every: Annotated[
        bool, typer.Option("--all", help="Every fast model with every law, whole ticks only.")
    ] = False,
    out: OutOption = None,
    force: Force = False,
) -> None:
    """Print what a tick of both loops costs, and each part of it."""
    from bench.measure.step_cost import run

    raise typer.Exit(run(ticks, out, model, controller, every=every, force=force))


@app.command()
def lockstep(
    *,
    seconds: Annotated[float, typer.Option(min=0.5, max=3600.0, help="Of the run.")] = 60.0,
    model: ModelOption = "harmonic",
    controller: LawOption = "cascade",
    out: OutOption = None,
) -> None:
    """Print how many times real time a run in one process goes, and the replay of its logs."""
    from bench.logs.replay.speed import run

    raise typer.Exit(run(seconds, out, model, controller))


@app.command()
def recorder(
    *,
    ticks: Annotated[int, typer.Option(min=10_000, max=100_000_000)] = 1_000_000,
    out: OutOption = None,
    force: Force = False,
) -> None:
    """Print how many ticks a second a recorder process takes, compression included."""
    from bench.measure.recorder_cost import run

    raise typer.Exit(run(ticks, out, force=force))


@app.command()
def soak(
    *,
    minutes: Annotated[float, typer.Option(min=0.1, max=10_000.0, help="How long.")] = 30.0,
    link: LinkOption = "zenoh",
    rate: Annotated[int, typer.Option(min=50, max=20_000, help="Ticks a second.")] = 1000,
    out: Annotated[
        Path | None, typer.Option(help="Directory of logs, soak.json and soak.png.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the run in --out.")] = False,
) -> None:
    """Run for a long time; memory, handles and the age of samples must stay flat."""
    from bench.measure.soak import run

    changes = [("link.kind", link), ("loop.rate_hz", rate)]
    raise typer.Exit(run(minutes, changes, out, force=force))


def register(hil: typer.Typer) -> None:
    """Add the group to `hil`."""
    hil.add_typer(app, rich_help_panel=MACHINE)
