"""Running a scenario from Python."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.api.judgement import conclude, told_of
from bench.api.result import Run
from bench.judge.summary import Summary
from bench.run import directory as outdir
from bench.run import scenarios
from bench.run.execution import Ended, execute, resolved
from bench.run.memory.execution import execute_here
from bench.run.memory.pair import Pair
from bench.run.progress import Silent
from bench.run.resolve import resolve as fill_in
from hil.config.load import build, with_override
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.errors import ConfigError, InterruptedRunError
from hil.toml import Tree

Given = str | Path | Mapping[str, Any] | Scenario
"""A scenario: its name, its file or FILE::CASE, its keys as a tree, or itself."""

_OPTIONS: Final = {
    "model": "plant.model", "controller": "controller.name", "seed": "run.seed",
    "link": "link.kind", "clock": "loop.clock", "bus": "link.bus",
}  # fmt: skip


def run(
    scenario: Given = "steady",
    changes: Mapping[str, Any] | None = None,
    *,
    out: Path | str | None = None,
    report: bool = False,
    force: bool = False,
    **overrides: Any,  # noqa: ANN401
) -> Run:
    """Run a scenario to its end and judge it.

    Without `link` both loops run in this thread over memory, in lockstep, as fast as they can; with
    `link="zenoh"` or "shm" as two processes in lockstep, with `link="can"` in real time.

    Parameters: scenario : name, file, FILE::CASE, tree of keys, or a Scenario
        changes : keys with their values, as in {"events.load.value": 0.9}
        out : directory of logs and summary; without it a temporary one, which the run keeps
        overrides : model, controller, seed, link, clock, bus; any other key with "__" for its dots

    Raises: ConfigError naming what is wrong and what is accepted. A run that goes wrong raises
        nothing: its verdict is "fault", and `run.reason` tells why
    """
    told = scenario_of(scenario, given_keys(changes, overrides))
    directory = Path(tempfile.mkdtemp(prefix="hil-api-")) if out is None else Path(out)
    files = outdir.prepare(told.name, directory, force=force)
    done = carry_out(told, files, report=report)
    if isinstance(done.ended.error, InterruptedRunError):
        raise KeyboardInterrupt from done.ended.error
    return Run(done.scenario, files, done.summary, passing=out is None)


def pair(
    scenario: Given = "steady",
    changes: Mapping[str, Any] | None = None,
    *,
    out: Path | str | None = None,
    **overrides: Any,  # noqa: ANN401
) -> Pair:
    """Return both loops of a scenario, to be stepped by hand; in memory, in lockstep.

    with hil.pair("steady") as pair:
        pair.advance(250)  # ticks
        pair.order({"kind": "set-point", "tdc_ref_m": 0.0152})
        pair.advance_to(1.0)  # s
        pair.plant.state.motion.x_m

    Parameters: as of `run`

    Raises: ConfigError likewise
    """
    whole = resolve(scenario, changes, **overrides)
    directory = (
        None if out is None else outdir.prepare(whole.name, Path(out), force=False).directory
    )
    return Pair(whole, directory)


def resolve(
    scenario: Given = "steady",
    changes: Mapping[str, Any] | None = None,
    **overrides: Any,  # noqa: ANN401
) -> Resolved:
    """Return the whole configuration of a run, with all that the scenario leaves open.

    Raises: ConfigError as `run`
    """
    return fill_in(scenario_of(scenario, given_keys(changes, overrides)))


class Done(NamedTuple):
    """A run that has been carried out and judged."""

    scenario: Resolved
    ended: Ended
    summary: Summary


def carry_out(scenario: Scenario, files: outdir.RunFiles, *, report: bool) -> Done:
    """Run a scenario, in this thread if that can be, else in processes; and judge it.

    Raises: ConfigError when it cannot begin
    """
    if scenario.link.kind == "memory" and scenario.loop.clock == "lockstep":
        whole = fill_in(scenario)
        ended = execute_here(whole, files)
    else:
        with resolved(scenario) as whole, told_of(files):
            ended = execute(whole, files, Silent())
    if isinstance(ended.error, ConfigError):
        raise ended.error
    with told_of(files):
        return Done(whole, ended, conclude(whole, ended, files, report=report))


def given_keys(changes: Mapping[str, Any] | None, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return all given keys with their values; clock and link first, so that others count."""
    link = overrides.get("link") or (changes or {}).get("link.kind", "memory")
    given: dict[str, Any] = {"link.kind": link}
    given["loop.clock"] = "realtime" if link == "can" else "lockstep"
    given |= changes or {}
    for name, value in overrides.items():
        if value is not None:
            given[_OPTIONS.get(name, name.replace("__", "."))] = value
    return given


def scenario_of(given: Given, changes: Mapping[str, Any]) -> Scenario:
    """Read a scenario and apply changes in their order.

    Raises: ConfigError naming file, key and what is accepted
    """
    if isinstance(given, str | Path):
        return scenarios.read(str(given), list(changes.items()))
    tree: Tree = given.model_dump() if isinstance(given, Scenario) else dict(given)
    for key, value in changes.items():
        tree = with_override(tree, key, value)
    return build(tree, str(tree.get("name", "scenario")))
