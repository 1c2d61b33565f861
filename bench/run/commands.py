"""What the commands of `hil` do; bench/cli/__init__.py only reads their arguments."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from bench import streams
from bench.api.judgement import conclude, told_of, write_report
from bench.bus import can_log, commands
from bench.judge import summary
from bench.judge.figures import read_run
from bench.live.beside import beside
from bench.report.quantities import size_of
from bench.run import conclusion, scenarios
from bench.run import directory as outdir
from bench.run.checks.times import beyond_the_end
from bench.run.directory import RunFiles
from bench.run.execution import execute, resolved, write_scenario
from bench.run.progress import view_for
from bench.run.resolve import resolve
from hil.config.load import read_scenario
from hil.config.resolved import Resolved, read_resolved
from hil.errors import ConfigError, InterruptedRunError, LogError, MissingExtraError
from hil.files import Output
from hil.toml import assignments_of


class RunOptions(NamedTuple):
    """The options of `hil run`."""

    out: Path | None
    report: bool
    force: bool
    can_log: Path | None = None
    panel: int | None = None
    foxglove: int | None = None


def overrides(flags: dict[str, Any], assignments: list[str]) -> list[tuple[str, Any]]:
    """Return the overrides of a run: the flags that were given, then --set in its order."""
    given = [(key, value) for key, value in flags.items() if value is not None]
    return given + assignments_of(assignments)


def log_flags(segment: str | None, retain: str | None) -> dict[str, Any]:
    """Return what --log-segment and --log-retain set.

    Raises: ConfigError naming what is accepted
    """
    flags: dict[str, Any] = {}
    if segment is not None:
        seconds = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*s", segment)
        if seconds:
            flags["log.segment_s"] = float(seconds[1])
        else:
            flags["log.segment_bytes"] = size_of(segment, "--log-segment")
    if retain is not None:
        flags["log.retain_bytes"] = size_of(retain, "--log-retain")
    return flags


def check_report(*, wanted: bool) -> None:
    """Refuse a run whose report could not be drawn at its end.

    Raises: MissingExtraError
    """
    if wanted and find_spec("uplot") is None:
        raise MissingExtraError("uplot-python", "desk", "the report (or give --no-report: it)")


def run(name: str, changes: list[tuple[str, Any]], options: RunOptions) -> int:
    """Run a scenario and tell how it went; returns the exit code.

    Raises: HilError with the line that the user is told
    """
    check_report(wanted=options.report)
    frames = None
    if options.can_log is not None:
        frames = can_log.output_of(options.can_log, force=options.force)
    console = Console(highlight=False)
    with resolved(scenarios.read(name, changes)) as scenario:
        files = outdir.prepare(scenario.name, options.out, force=options.force)
        for late in beyond_the_end(scenario):
            streams.say(f"{name}: {late}: left out")
        streams.outlive()
        with _servers_of(scenario, files, options):
            with told_of(files), view_for(scenario, console) as view:
                ended = execute(scenario, files, view)
            if isinstance(ended.error, ConfigError):
                raise ended.error
            with told_of(files):
                told = conclude(scenario, ended, files, report=options.report)
    if frames is not None and files.plant_log.exists():
        commands.write_can_log(frames, scenario, files, ended.started)
    if isinstance(ended.error, InterruptedRunError):
        raise ended.error
    if told["verdict"] == "fault":
        streams.say(told["exit_reason"])
    else:
        conclusion.show(console, told, files.report if options.report else None, files.directory)
        if "bus" in told["run"]:
            console.print(commands.line_of_figures(told["run"]["bus"]), soft_wrap=True)
    return int(told["exit_code"])


@contextmanager
def _servers_of(scenario: Resolved, files: RunFiles, options: RunOptions) -> Iterator[None]:
    """Have a panel and a server for viewers beside the run, if they are to be."""
    if options.panel is not None:
        from bench.panel.server import check_libraries

        check_libraries()
    if options.foxglove is not None:
        from bench.live.foxglove.server import check_library

        check_library()
    if options.panel is not None or options.foxglove is not None:
        write_scenario(scenario, files)
    with (
        beside(["panel", "--no-browser"], files.directory, options.panel),
        beside(["foxglove"], files.directory, options.foxglove),
    ):
        yield


def report(directory: Path, picture: Path | None, *, force: bool = False) -> int:
    """Judge and draw a finished run again, from its logs; its own summary and report are new."""
    files = outdir.opened(directory)
    drawn = None
    if picture is not None:
        drawn = Output("--picture", picture, force, tuple(files.existing()))
        drawn.check(".svg")
    data = read_run(read_resolved(files.scenario), files)
    if not data.truth.ticks:
        raise LogError(f"{files.plant_log}: nothing to judge or draw: it has no rows of /truth")
    told = summary.summarise(data, summary.read_run_facts(files))
    summary.write(told, files.summary)
    write_report(data, told, files)
    if drawn is not None:
        from bench.report.document import save_picture

        save_picture(data, files, drawn)
    conclusion.show(Console(highlight=False), told, files.report, files.directory)
    return 0


def list_scenarios() -> int:
    """Print a table of what can be run."""
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("scenario", "shows", "takes", "events"):
        table.add_column(title, no_wrap=title in {"scenario", "takes"})
    for path in scenarios.packaged():
        scenario = scenarios.read(path.stem)
        duration = f"{scenario.run.duration_s:g} s"
        table.add_row(scenario.name, scenario.description, duration, ", ".join(scenario.events))
    Console(highlight=False).print(table)
    return 0


def process(side: str, config: Path, log: Path | None, *, force: bool = False) -> int:
    """Run one process, with what its configuration leaves open filled in."""
    if log is not None:
        Output("--log", log, force, (config,)).check()
    scenario = resolve(read_scenario(config))
    if side == "plant":
        from plant.main import run as run_plant

        return run_plant(scenario, log)
    from controller.main import run as run_controller

    return run_controller(scenario, log)
