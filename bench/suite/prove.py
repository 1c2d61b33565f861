"""`hil scenario prove`: does each expectation fail when something is wrong?

The scenario is run as it is, and has to meet its expectations; then with one fault after the other
in controller or plant, until each expectation has failed. One that no fault can break is vacuous.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from bench.judge.checks import Check, judge
from bench.judge.figures import RunData, read_run
from bench.judge.window import window_of
from bench.progress import counted, progress
from bench.run.directory import RunFiles
from bench.run.memory.execution import execute_here
from bench.run.resolve import resolve
from bench.run.scenarios import Found, read_cases
from bench.suite.mutants import mutants
from hil.config.check import check
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.errors import ConfigError, HilError

Changes = list[tuple[str, object]]
_EARLY = 0.05
"""Share of the run after which a fault begins that is there nearly throughout."""

_AFTER_S = 0.02
_NEEDS_VALUES = ("min", "max", "tolerance", "peak_mm")


class Proof(NamedTuple):
    """One demand of an expectation, and the first fault by which it failed; "" when by none.

    text: what was found without a fault
    """

    name: str
    broken_by: str
    text: str


class NotMetError(HilError):
    """A scenario that does not meet its expectations without any fault."""

    exit_code = 1


def prove(scenario: Scenario) -> list[Proof]:
    """Run a scenario with fault after fault until every demand has failed once.

    Raises: ConfigError when it cannot be run; NotMetError when it fails as it is
    """
    changed = {"link": {**scenario.link.model_dump(), "kind": "memory"}}
    loop = {"loop": {**scenario.loop.model_dump(), "clock": "lockstep"}}
    whole = resolve(check(Scenario, scenario.model_dump() | changed | loop, scenario.name))
    data = _run(whole)
    checks = judge(data)
    failed = [one.text for one in checks if not one.met]
    if failed:
        raise NotMetError(f"{scenario.name}: not met without any fault: {'; '.join(failed)}")
    open_ = {_name(one): Proof(_name(one), "", one.text) for one in checks}
    proofs = dict(open_)
    tried = list(mutants(whole, _instants_s(data)))
    with progress(f"prove {whole.name}", len(tried), "faults") as advance:
        for mutant in counted(tried, advance):
            if not open_:
                break
            for name in _broken(mutant.tree, whole.name) & open_.keys():
                proofs[name] = open_.pop(name)._replace(broken_by=mutant.name)
    return list(proofs.values())


def _name(found: Check) -> str:
    return f"expect.{found.name}.{found.key}"


def _run(scenario: Resolved) -> RunData:
    with tempfile.TemporaryDirectory(prefix="hil-prove-") as directory:
        files = RunFiles(Path(directory))
        execute_here(scenario, files)
        return read_run(scenario, files)


def _broken(tree: dict[str, object], name: str) -> set[str]:
    """Return the demands that fail with a fault."""
    try:
        data = _run(check(Resolved, tree, name))
    except HilError:  # a fault that this engine, law or scenario cannot have
        return set()
    return {_name(one) for one in judge(data) if not one.met and _was_judged(data, one)}


def _was_judged(data: RunData, one: Check) -> bool:
    """Whether there was anything to judge.

    That its event did not happen, or that no value of its signal came, breaks every expectation,
    whatever it demands: it says nothing of the demand.
    """
    window = window_of(data, data.scenario.expect[one.name])
    if window is None:
        return False
    if one.key == "within_mm":
        return len(data.strokes.since(window.start_ns).t_ns) > 0
    return one.found is not None or one.key not in _NEEDS_VALUES


def _instants_s(data: RunData) -> list[float]:
    """Early in the run, and just after each beginning of an expectation and each of its ends."""
    duration_s = data.scenario.run.duration_s
    found = {_EARLY * duration_s}
    for expectation in data.scenario.expect.values():
        window = window_of(data, expectation)
        if window is not None:
            found.add(window.start_ns * 1e-9 + _AFTER_S)
            found.add(window.start_ns * 1e-9 + expectation.after_s + _AFTER_S)
    return sorted(t_s for t_s in found if t_s < duration_s)


def run(names: Sequence[str], changes: Changes) -> int:
    """Prove every scenario of some names; print what breaks what; 1 when something is vacuous.

    Raises: ConfigError, NotMetError as `prove`
    """
    console = Console(highlight=False, markup=False, soft_wrap=True)
    found: list[Found] = [one for name in names for one in read_cases(name)]
    vacuous = [name for one in found for name in _proved(console, one, changes)]
    if vacuous:
        console.print(f"vacuous, no fault breaks it: {', '.join(vacuous)}", style="red")
    return 1 if vacuous else 0


def _proved(console: Console, found: Found, changes: Changes) -> list[str]:
    scenario = found.scenario(changes)
    if not scenario.expect:
        raise ConfigError(
            f"{found.label}: expects nothing; accepted is a scenario with [expect.NAME]"
        )
    console.print(found.label, style="bold")
    proofs = prove(scenario)
    for proof in proofs:
        told = f"fails when {proof.broken_by}" if proof.broken_by else "VACUOUS"
        console.print(f"  {proof.name}: {told}", style="" if proof.broken_by else "red")
    return [proof.name for proof in proofs if not proof.broken_by]
