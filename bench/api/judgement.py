"""The end of a run: what its logs come to, in summary and report."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from bench.bus import commands
from bench.judge import summary
from bench.judge.figures import RunData, read_run
from bench.logs.mending import mend
from bench.run.directory import RunFiles
from bench.run.execution import Ended
from hil.config.resolved import Resolved
from hil.errors import ConfigError, InterruptedRunError, LogError, RunError


@contextmanager
def told_of(files: RunFiles) -> Iterator[None]:
    """A file that cannot be written once the run has begun is no mistake of the user's.

    Raises: RunError
    """
    try:
        yield
    except OSError as error:
        where = error.filename or files.directory
        raise RunError(f"{where}: {error.strerror or error}; logs: {files.directory}") from None
    except ConfigError as error:  # of an output file of ours: its place was right at the start
        _, place, why = str(error).partition(str(files.directory))
        if not place:
            raise
        raise RunError(f"{place}{why}; logs: {files.directory}") from None


def conclude(scenario: Resolved, ended: Ended, files: RunFiles, *, report: bool) -> summary.Summary:
    """Judge the logs, write summary and report; a fault leaves as much of both as there is."""
    facts: dict[str, Any] = {
        "started": ended.started,
        "wall_total_s": ended.wall_s,
        "directory": str(files.directory),
        "processes": ended.processes,
    }
    if ended.error is not None:
        facts |= {"error": str(ended.error), "exit_code": ended.exit_code}
    for log in (files.plant_log, files.controller_log):
        mend(log)
    if isinstance(ended.error, InterruptedRunError):  # judging may take longer than a user waits
        told = summary.summarise_fault(scenario, facts)
        summary.write(told, files.summary)
        return told
    try:
        data = read_run(scenario, files)
    except LogError as error:
        facts = {"error": str(error), "exit_code": RunError.exit_code} | facts
        told = summary.summarise_fault(scenario, facts)
        summary.write(told, files.summary)
        return told
    if ended.error is None:
        facts |= cut_short(data)
    if scenario.link.kind == "can":
        facts["bus"] = commands.figures(scenario, files)
    told = summary.summarise(data, facts)
    summary.write(told, files.summary)
    if report and len(data.strokes.t_ns):
        write_report(data, told, files)
    return told


def cut_short(data: RunData) -> dict[str, Any]:
    """A run that was ended from outside is no run that met its expectations."""
    wanted = round(data.scenario.run.duration_s * data.scenario.loop.rate_hz)
    ticks = data.truth.ticks
    if data.scenario.log.retain_bytes is not None:  # earlier ticks may be gone, and on purpose
        ticks = round(data.truth.end_ns * 1e-9 * data.scenario.loop.rate_hz) + 1
    if ticks >= wanted:
        return {}
    line = f"the plant's log ends after {ticks} of {wanted} ticks"
    if "plant" in data.recorders:
        missing = data.recorders["plant"]["missing"]
        line = f"the plant's log lacks {wanted - ticks} of {wanted} ticks: {missing}"
    return {"error": line, "exit_code": RunError.exit_code}


def write_report(data: RunData, told: summary.Summary, files: RunFiles) -> None:
    """Draw the report of a run."""
    from bench.report.document import write_report

    write_report(data, told, files)
