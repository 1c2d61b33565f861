"""`hil bus`: CAN buses; what is heavy is imported by the command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import MACHINE, Commands

app = Commands("bus", "List, watch and try out CAN buses.")

BusArgument = Annotated[str, typer.Argument(metavar="INTERFACE:CHANNEL", help="As in zenoh:can0.")]


@app.command("list")
def list_() -> None:
    """List the buses that a run could join."""
    from bench.bus import monitor as bus_monitor

    raise typer.Exit(bus_monitor.list_buses())


@app.command()
def monitor(
    bus: BusArgument,
    *,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="End after so long [s].")] = None,
    count: Annotated[int | None, typer.Option(min=1, help="End after so many frames.")] = None,
    every: Annotated[bool, typer.Option("--every", help="A line for each frame.")] = False,
) -> None:
    """Show what goes over a bus, decoded and judged; joins while a run is on it."""
    from bench.bus import monitor as bus_monitor

    raise typer.Exit(bus_monitor.monitor(bus, seconds, count, every=every))


@app.command()
def load(
    directory: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run: its directory, or a file in it.")
    ],
    *,
    bitrate: Annotated[int | None, typer.Option(min=10_000, help="Of another bus [bit/s].")] = None,
) -> None:
    """Say how full the bus was in a run, tick by tick, with every stuff bit."""
    from bench.bus import commands

    raise typer.Exit(commands.load(directory, bitrate))


@app.command()
def faults() -> None:
    """Run the cascade on a bus with one fault after the other."""
    from bench.bus import faults as bus_faults

    raise typer.Exit(bus_faults.show())


@app.command()
def fuzz(
    *,
    frames: Annotated[int, typer.Option(min=100, help="How many, of both kinds.")] = 1_000_000,
    seed: Annotated[int, typer.Option(help="Of everything random.")] = 1,
) -> None:
    """Feed random and mutated frames to the decoders of both processes."""
    from bench.bus import fuzz as bus_fuzz

    bus_fuzz.report(frames, seed)


@app.command()
def cost() -> None:
    """Measure what the codec takes for one tick, beside cantools."""
    from bench.measure import codec_cost

    raise typer.Exit(codec_cost.main())


def register(root: typer.Typer) -> None:
    """Put the commands under `hil bus`."""
    root.add_typer(app, rich_help_panel=MACHINE)
