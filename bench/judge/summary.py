"""summary.json: verdict and figures of a run under stable names (docs/operations.md)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.judge.cause import Cause, cause_of
from bench.judge.checks import judge
from bench.judge.figures import RunData, event_figures, figures
from bench.judge.verdict import Verdict, conclude, refusals
from bench.run.directory import RunFiles
from drivers.system.log import versions
from hil.config.resolved import Resolved
from hil.errors import PEER_LOST, BlockedError, LogError
from hil.files import Output

SCHEMA = 1

Summary = dict[str, Any]


def summarise(data: RunData, run: dict[str, Any]) -> Summary:
    """Judge a run and gather its figures.

    Parameters: run : what the orchestration knows: how the processes ended, wall time, error
    """
    checks, refused = judge(data), refusals(data)
    cause = cause_of(data.scenario, data.trace, run.get("processes", {}))
    loop_s = [p["loop_s"] for p in run.get("processes", {}).values() if p.get("loop_s")]
    return {
        **_head(data.scenario, _fault(run, cause) or conclude(checks, refused, cause)),
        "expectations": [check._asdict() for check in checks],
        "refused": refused,
        "cause": None if cause is None else cause.text,
        "figures": {**figures(data, max(loop_s, default=None)), **_effort(run)},
        "events": event_figures(data),
        **_tail(data.scenario, {**run, **_recording(data)}),
    }


def _recording(data: RunData) -> dict[str, Any]:
    """What is to be said of the logs, if anything is."""
    told: dict[str, Any] = {"recorders": data.recorders} if data.recorders else {}
    return {**told, "recording": "deferred"} if data.scenario.log.defer else told


def _effort(run: dict[str, Any]) -> dict[str, float]:
    """Processor use of plant, controller and both recorders together, in cores."""
    told = [p for p in run.get("processes", {}).values() if p.get("cpu_s") and p.get("loop_s")]
    if not told:
        return {}
    cores = sum((p["cpu_s"] + p["recorder_cpu_s"]) / p["loop_s"] for p in told)
    return {"processor_cores": cores}


def summarise_fault(scenario: Resolved, run: dict[str, Any]) -> Summary:
    """Return the summary of a run whose logs cannot be read."""
    empty: Summary = {
        "expectations": [], "refused": [], "cause": None, "figures": {}, "events": [],
    }  # fmt: skip
    verdict = _fault(run) or conclude([], [])
    return {**_head(scenario, verdict), **empty, **_tail(scenario, run)}


def _fault(run: dict[str, Any], cause: Cause | None = None) -> Verdict | None:
    """Return the verdict of a run that did not end as it should, None when it did.

    A peer that was lost to the machine, though nobody has ended it, is no fault of either.
    """
    error = run.get("error")
    if not error:
        return None
    if cause is not None and cause.by_machine and PEER_LOST in error:
        return Verdict("blocked", BlockedError.exit_code, f"{cause.text}; {error}")
    return Verdict("fault", run["exit_code"], error)


def _head(scenario: Resolved, verdict: Verdict) -> Summary:
    """Name, verdict, exit code and its reason."""
    return {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "description": scenario.description,
        "verdict": verdict.name,
        "exit_code": verdict.exit_code,
        "exit_reason": verdict.reason,
    }


def _tail(scenario: Resolved, run: dict[str, Any]) -> Summary:
    """How it was run, and by which versions."""
    return {
        "run": {
            "model": scenario.plant.model,
            "prototype": scenario.plant.prototype,
            "controller": scenario.controller.name,
            "link": scenario.link.kind,
            "clock": scenario.loop.clock,
            "rate_hz": scenario.loop.rate_hz,
            "duration_s": scenario.run.duration_s,
            "seed": scenario.run.seed,
            **run,
        },
        "versions": versions(),
    }


def write(summary: Summary, path: Path) -> None:
    """Write a summary; a figure that is no finite number becomes null."""
    text = json.dumps(_finite(summary), indent=1)
    Output("summary", path, force=True).write(f"{text}\n")


def _finite(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def read_run_facts(files: RunFiles) -> dict[str, Any]:
    """Return what an earlier summary says that no log knows: processes, wall time, error.

    Raises: LogError when the summary is there and is none
    """
    if not files.summary.exists():
        return {}
    try:
        run = json.loads(files.summary.read_text(encoding="utf-8"))["run"]
    except (ValueError, KeyError, TypeError):
        raise LogError(f"{files.summary}: no summary of a run; remove it to go on") from None
    kept = ("started", "wall_total_s", "processes", "error", "exit_code", "directory")
    return {key: run[key] for key in kept if key in run}
