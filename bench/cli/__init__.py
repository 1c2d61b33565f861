"""The `hil` command: its arguments. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bench.cli import bus as bus_cli
from bench.cli import engine, fmu, measure, operate, studies
from bench.cli.logs import register as register_logs
from bench.cli.options import Assignments
from bench.interrupt import EXIT_CODE, is_interrupt, told
from hil.config.names import ClockName, LinkName

app = typer.Typer(
    name="hil",
    help="Hardware-in-the-loop bench for a free-piston engine generator.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)

LinkOption = Annotated[
    LinkName | None,
    typer.Option(help="How plant and controller are joined."),
]
BusOption = Annotated[
    str | None, typer.Option(metavar="INTERFACE:CHANNEL", help="CAN bus, with --link can.")
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


@app.command()
def run(
    scenario: Annotated[
        str, typer.Argument(help="Name (see `hil scenarios`) or a path to a .toml file.")
    ],
    *,
    link: LinkOption = None,
    bus: BusOption = None,
    clock: ClockOption = None,
    model: Annotated[str | None, typer.Option(help="Engine model of the plant.")] = None,
    controller: Annotated[str | None, typer.Option(help="Law of the piston motion.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory of logs, summary and report.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a run that --out holds.")] = False,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write no report.html.")] = False,
    log_segment: Annotated[
        str | None, typer.Option(metavar="SIZE", help="Log in files of 256MiB, or of 600s each.")
    ] = None,
    log_retain: Annotated[
        str | None, typer.Option(metavar="SIZE", help="Keep no more than this of earlier files.")
    ] = None,
    can_log: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also log the frames: .log, .asc or .blf.")
    ] = None,
    assignments: Assignments = None,
) -> None:
    """Run a scenario: plant and controller, logs, verdict, report.

    Exit code 0: every expectation met; 1: one was not; 2: bad arguments or configuration;
    3: a fault at run time; 4: an order of the scenario was refused.
    """
    from bench.run import commands

    flags = {
        "link.kind": link,
        "link.bus": bus,
        "loop.clock": clock,
        "plant.model": model,
        "controller.name": controller,
        "run.seed": seed,
        **commands.log_flags(log_segment, log_retain),
    }
    changes = commands.overrides(flags, assignments or [])
    options = commands.RunOptions(out, not no_report, force, can_log)
    raise typer.Exit(commands.run(scenario, changes, options))


@app.command()
def scenarios() -> None:
    """List the scenarios that come with the project."""
    from bench.run import commands

    raise typer.Exit(commands.list_scenarios())


ConfigOption = Annotated[
    Path, typer.Option("--config", help="Scenario: a .toml file, or scenario.json of a run.")
]
LogOption = Annotated[Path | None, typer.Option("--log", help="MCAP file to write.")]


@app.command()
def plant(config: ConfigOption, log: LogOption = None) -> None:
    """Run the plant process alone."""
    from bench.run import commands

    raise typer.Exit(commands.process("plant", config, log))


@app.command()
def controller(config: ConfigOption, log: LogOption = None) -> None:
    """Run the controller process alone."""
    from bench.run import commands

    raise typer.Exit(commands.process("controller", config, log))


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(help="Directory of a finished run.")],
    picture: Annotated[
        Path | None, typer.Option(help="Also write the overview alone, as an SVG file.")
    ] = None,
) -> None:
    """Judge and draw a finished run again, from its logs."""
    from bench.run import commands

    raise typer.Exit(commands.report(directory, picture))


@app.command()
def check() -> None:
    """Say what this machine can do, and how to mend what it cannot."""
    from bench.measure.machine import look_around

    raise typer.Exit(look_around())


@app.command("compile")
def compile_modules(
    into: Annotated[
        Path | None, typer.Option(help="Directory for the result; HIL_COMPILED names it to a run.")
    ] = None,
) -> None:
    """Compile what runs in every tick: the same numbers in less than half the time (needs gcc)."""
    from bench.dev.compile import run

    raise typer.Exit(run(into))


register_logs(app)
operate.register(app)
measure.register(app)
studies.register(app)
bus_cli.register(app)
engine.register(app)
fmu.register(app)


def main() -> None:
    """Entry point of `hil`: a known failure is one line on standard error and its exit code."""
    try:
        code = app(standalone_mode=False)
        if code == EXIT_CODE:  # what the library that reads arguments makes of it, and says nothing
            raise KeyboardInterrupt
        sys.exit(code)
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(told())
    except OSError as error:
        print(f"{error.filename or 'file'}: {error.strerror or error}", file=sys.stderr)
        sys.exit(2)
    except Exception as error:
        if is_interrupt(error):
            sys.exit(told())
        line, code = _told(error)
        if not line:
            raise
        print(line, file=sys.stderr)
        sys.exit(code)


def _told(error: Exception) -> tuple[str, int]:
    """What a failure is in one line, and its exit code; an empty line when it is none of ours."""
    from hil.errors import HilError

    if isinstance(error, HilError):
        return str(error), error.exit_code
    context, message = getattr(error, "ctx", None), getattr(error, "format_message", None)
    if message is None:
        return "", 1
    if type(error).__name__ == "NoArgsIsHelpError" and context is not None:
        return str(context.get_help()), 2
    where = f" ({context.command_path} --help tells more)" if context is not None else ""
    return " ".join(message().replace("Value error, ", "").split()) + where, 2  # of the parser


if __name__ == "__main__":
    main()
