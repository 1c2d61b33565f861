"""The `hil` command: its arguments. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from bench.cli import bus as bus_cli
from bench.cli import engine, fmu, measure, operate, own, panel, studies
from bench.cli import scenario as scenario_cli
from bench.cli.logs import register as register_logs
from bench.cli.options import MACHINE, RUNS, Assignments, Commands, Force
from bench.ending import run_to_end
from hil import compiled
from hil.config.names import ClockName, LinkName
from hil.errors import ConfigError

app = Commands("hil", "Hardware-in-the-loop bench for a free-piston engine generator.")

LinkOption = Annotated[
    LinkName | None,
    typer.Option(help="How plant and controller are joined."),
]
BusOption = Annotated[
    str | None, typer.Option(metavar="INTERFACE:CHANNEL", help="CAN bus, with --link can.")
]
ModelOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Engine model: {models}, fmu:FILE, or a .py file."),
]
PrototypeOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Engine: {prototypes}, or a .toml file of one's own."),
]
LawOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="Law of the piston motion: {laws}, or a .py file of one's own."
    ),
]
OutOption = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Directory of logs, summary and report.")
]
ClockOption = Annotated[
    ClockName | None,
    typer.Option(help="In real time, or as fast as both can."),
]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"fpeg-hil {version('fpeg-hil')}")
        raise typer.Exit


@app.callback()
def root(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Hardware-in-the-loop bench for a free-piston engine generator."""


SizeOption = typer.Option(metavar="SIZE", help="Log in files of 256MiB, or of 600s each.")
RetainOption = typer.Option(metavar="SIZE", help="Keep no more than this of earlier files.")
CanLogOption = typer.Option(metavar="FILE", help="Also log the frames: .log, .asc or .blf.")
PanelOption = typer.Option(metavar="[PORT]", help="Serve the panel beside the run.")
FoxgloveOption = typer.Option(metavar="[PORT]", help="Serve Foxglove and its like beside the run.")
JunitOption = typer.Option(metavar="FILE", help="Also write a JUnit file of all scenarios.")
ScenarioArgument = typer.Argument(
    metavar="SCENARIO", help="Names (see `hil scenarios`), paths to .toml files, or FILE::CASE."
)


@app.command(heading=RUNS)
def run(
    scenario: Annotated[list[str], ScenarioArgument],
    *,
    link: LinkOption = None,
    bus: BusOption = None,
    clock: ClockOption = None,
    model: ModelOption = None,
    prototype: PrototypeOption = None,
    controller: LawOption = None,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random.")] = None,
    out: OutOption = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a run that --out holds.")] = False,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write no report.html.")] = False,
    log_segment: Annotated[str | None, SizeOption] = None,
    log_retain: Annotated[str | None, RetainOption] = None,
    can_log: Annotated[Path | None, CanLogOption] = None,
    panel: Annotated[int | None, PanelOption] = None,
    foxglove: Annotated[int | None, FoxgloveOption] = None,
    junit: Annotated[Path | None, JunitOption] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all results as JSON.")] = False,
    assignments: Assignments = None,
) -> None:
    """Run scenarios: plant and controller, logs, verdict, report.

    Several, or all cases of a file, are run one after the other and told in one table.

    Exit code 0: every expectation met; 1: one was not; 2: bad arguments or configuration;
    3: a fault at run time; 4: no verdict, an order was refused or the machine spoilt the run.
    """
    from bench.run import commands
    from bench.suite import commands as suite

    flags = {
        "link.kind": link, "link.bus": bus, "loop.clock": clock, "plant.model": model,
        "plant.prototype": prototype, "controller.name": controller, "run.seed": seed,
        **commands.log_flags(log_segment, log_retain),
    }  # fmt: skip
    changes = commands.overrides(flags, assignments or [])
    options = commands.RunOptions(out, not no_report, force, can_log, panel, foxglove)
    if suite.is_suite(scenario, junit=junit, as_json=as_json):
        raise typer.Exit(suite.run(scenario, changes, suite.of(options, junit, as_json=as_json)))
    raise typer.Exit(commands.run(scenario[0], changes, options))


@app.command(heading=RUNS)
def scenarios() -> None:
    """List the scenarios that come with the project."""
    from bench.run import commands

    raise typer.Exit(commands.list_scenarios())


ConfigOption = Annotated[
    Path,
    typer.Option(
        "--config", metavar="FILE", help="Scenario: a .toml file, or scenario.json of a run."
    ),
]
LogOption = Annotated[
    Path | None, typer.Option("--log", metavar="FILE", help="MCAP file to write.")
]


@app.command(heading=MACHINE)
def plant(config: ConfigOption, log: LogOption = None, *, force: Force = False) -> None:
    """Run the plant process alone."""
    from bench.run import commands

    raise typer.Exit(commands.process("plant", config, log, force=force))


@app.command(heading=MACHINE)
def controller(config: ConfigOption, log: LogOption = None, *, force: Force = False) -> None:
    """Run the controller process alone."""
    from bench.run import commands

    raise typer.Exit(commands.process("controller", config, log, force=force))


@app.command(heading=RUNS)
def report(
    directory: Annotated[
        Path, typer.Argument(metavar="RUN", help="A finished run: its directory, or a file in it.")
    ],
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write the overview alone, as an SVG file."),
    ] = None,
    *,
    force: Force = False,
) -> None:
    """Judge and draw a finished run again, from its logs."""
    from bench.run import commands

    raise typer.Exit(commands.report(directory, picture, force=force))


@app.command(heading=MACHINE)
def check(
    what: Annotated[
        Literal["machine", "trust", "law", "engine"],
        typer.Argument(help="What this machine can do, what is promised, or what is one's own."),
    ] = "machine",
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="Its .py file, for `law` and `engine`.")
    ] = None,
    *,
    quick: Annotated[bool, typer.Option("--quick", help="Few tries of each attack.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write the table as a page (.md).")
    ] = None,
    force: Force = False,
) -> None:
    """Say what this machine can do; or attack what is promised.

    What it cannot do is told with how to mend it. `trust` kills, stops and floods runs and damages
    logs; `law` and `engine` try whether one's own does what the loops rely on. Exit code 1: a
    promise was not kept.
    """
    if what in ("law", "engine"):
        from bench.own.conformance import run as conform

        if file is None:
            raise ConfigError(f"hil check {what}: accepted is a .py file, as in ./my_{what}.py")
        raise typer.Exit(conform(what, file))
    if what == "trust":
        from bench.trust.page import run as attack
        from hil.files import Output

        page = None if out is None else Output("--out", out, force)
        raise typer.Exit(attack(page, quick=quick))
    from bench.measure.machine import look_around

    raise typer.Exit(look_around())


@app.command("compile", heading=MACHINE)
def compile_modules(
    into: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Directory for the result; HIL_COMPILED names it to a run."
        ),
    ] = None,
) -> None:
    """Compile what runs in every tick: the same numbers, sooner.

    In less than half the time; needs gcc, and a minute.
    """
    from bench.dev.compile import run

    raise typer.Exit(run(into))


register_logs(app)
operate.register(app)
panel.register(app)
measure.register(app)
studies.register(app)
bus_cli.register(app)
engine.register(app)
fmu.register(app)
own.register(app)
scenario_cli.register(app)


def _tell_of_edits() -> None:
    """Say on standard error that an edit has taken the compiled loops out of use."""
    changed = compiled.edited()
    if changed:
        others = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        print(
            f"{changed[0]}{others} changed since `hil compile`: the loops are interpreted until it "
            "is run again", file=sys.stderr,
        )  # fmt: skip


def main() -> None:
    """Entry point of `hil`: a known failure is one line on standard error and its exit code."""
    if sys.argv[1:2] != ["compile"]:
        _tell_of_edits()
    sys.exit(run_to_end(lambda: app(standalone_mode=False)))


if __name__ == "__main__":
    main()
