"""Reference runs: what a redesign must leave as it is, recorded before and compared after.

    python -m bench.dev.reference record DIR [NAME ...]
    python -m bench.dev.reference compare DIR DIR [NAME ...]

They hold the golden runs and those whose bits depend on this machine's compiler: every detailed
engine, exported units, and the links between two processes. NAME is a pattern, as in 'unit-*/*'.
Recorded twice by one version they are the same in every topic and field, times included: all run
in lockstep.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from fnmatch import fnmatch
from multiprocessing import get_context
from pathlib import Path
from typing import Final, NamedTuple

from bench.dev import golden
from bench.dev.golden_cases import CASES, Case, Changes, scenario_for
from bench.logs.diff import Comparison, compare
from bench.report.quantities import thousands
from drivers.system.process import guarded
from hil import log as logs
from hil.errors import ConfigError, LogError, RunError
from hil.log import Log

_WORKERS: Final = 2
_TIMEOUT_S: Final = 300.0
_LEFT_OUT: Final = ("/snapshot",)
"""How a loop keeps its state is its own: what it comes to is in the other topics."""

_FREE_ENGINES: Final = (("two-stroke", "nu"), ("two-stroke", "bit"), ("starting", "bit"))
_UNFIRED_ENGINES: Final = (
    ("four-stroke", "nu"), ("motoring", "nu"), ("two-stroke", "gas-spring"),
    ("two-stroke", "opposed"), ("four-stroke", "mechanical-spring"),
)  # fmt: skip
"""Those that know strokes without combustion: they begin settled and take open-loop alone."""

# The golden run `harmonic` is a load step; on another engine it keeps its name.
_ON_EVERY_ENGINE: Final = (
    "harmonic", "open-loop", "live-set-points", "live-laws", "live-stop-start", "live-faults",
    "operator", "sensor-x-hold", "sensor-x-offset", "sensor-implausible", "sensor-noise",
    "command-delay", "unequal-injectors", "misfire-part-load", "no-load", "target-power",
    "contact", "faster",
)  # fmt: skip
_ON_FREE_ENGINES: Final = (
    "single-loop", "pdf", "pdf-command", "predictive", "start", "misfire", "misfire-fuel",
    "misfire-unloaded", "sensor-x-value", "sensor-v-hold", "sensor-v-value", "sensor-v-offset",
)  # fmt: skip
_UNITS: Final = {
    "closed-form": "2", "harmonic": "3", "rectangular": "3", "nonlinear": "2", "two-stroke": "3",
    "four-stroke": "2", "starting": "3",
}  # fmt: skip
"""Models with the version of the standard that each is exported for."""

_ON_UNITS: Final = ("harmonic", "operator", "live-faults", "command-delay", "misfire-part-load")
_LINKS: Final[dict[str, Changes]] = {
    "memory": (), "shm": (), "zenoh": (), "can": (("link.bus", "zenoh:reference"),),
}  # fmt: skip


class Run(NamedTuple):
    """One reference run; `link` joins two processes by it, `unit` is the model of an export."""

    name: str
    case: Case
    link: str = ""
    unit: str = ""


def runs() -> Iterator[Run]:
    """Yield all reference runs."""
    known = {case.name: case for case in CASES}
    for name, case in known.items():
        yield Run(f"golden/{name}", case)
    for engines, names in ((_FREE_ENGINES, _ON_FREE_ENGINES), (_UNFIRED_ENGINES, ())):
        for model, prototype in engines:
            engine: Changes = (("plant.model", model), ("plant.prototype", prototype))
            for name in (*_ON_EVERY_ENGINE, *names):
                yield Run(f"{model}-{prototype}/{name}", _changed(known[name], engine))
    for model in _UNITS:
        for name in (*_ON_UNITS, *(() if model == "four-stroke" else ("start",))):
            yield Run(f"unit-{model}/{name}", known[name], unit=model)
    for link, changes in _LINKS.items():
        yield Run(f"link/{link}", _changed(known["harmonic"], changes), link)


def record(directory: Path, patterns: list[str]) -> int:
    """Record what the patterns name, or all; 3 when a run has failed.

    Raises: ConfigError when the directory holds runs already, or no run has such a name
    """
    chosen = [run for run in runs() if _is_wanted(run.name, patterns)]
    if not chosen:
        raise ConfigError(f"no reference run {' '.join(patterns)}; accepted as in 'golden/*'")
    if next(directory.glob("*/*/*.mcap"), None) is not None:
        raise ConfigError(f"{directory}: holds runs already; accepted is another directory")
    with ProcessPoolExecutor(_WORKERS, get_context("spawn")) as pool:
        units = sorted({run.unit for run in chosen} - {""})
        tasks = {f"unit {unit}": pool.submit(_export, unit, directory) for unit in units}
        failed = _told(tasks)
        failed += _told({run.name: pool.submit(_record, run, directory) for run in chosen})
    return RunError.exit_code if failed else 0


def compare_all(a: Path, b: Path, patterns: list[str]) -> int:
    """Compare two recordings log by log; 0 when all are the same, 1 when not.

    Raises: LogError when there is nothing to compare
    """
    paths = {
        path.relative_to(side)
        for side in (a, b)
        for path in side.glob("*/*/*.mcap")
        if _is_wanted(str(path.relative_to(side).parent), patterns)
    }
    if not paths:
        raise LogError(f"{a}, {b}: no reference runs of that name")
    different = 0
    for path in sorted(paths):
        verdict = _verdict(a / path, b / path)
        different += not verdict.startswith("same")
        print(f"{path.with_suffix('')}: {verdict}")
    print(f"{len(paths)} logs, {different} differ")
    return 1 if different else 0


def _is_wanted(name: str, patterns: list[str]) -> bool:
    return not patterns or any(fnmatch(name, pattern) for pattern in patterns)


def _changed(case: Case, changes: Changes) -> Case:
    return case._replace(changes=(*case.changes, *changes))


def _told(tasks: dict[str, Future[None]]) -> int:
    """Wait for each and say how it ended; returns how many failed."""
    failed = 0
    for name, task in tasks.items():
        error = task.exception()
        failed += error is not None
        print(f"{name}: {'done' if error is None else f'{type(error).__name__}: {error}'}")
    return failed


def _unit_path(unit: str, directory: Path) -> Path:
    return directory.resolve() / f"unit-{unit}" / "engine.fmu"


def _export(unit: str, directory: Path) -> None:
    """Write a unit where its runs look for it."""
    path = _unit_path(unit, directory)
    path.parent.mkdir(parents=True, exist_ok=True)
    _hil("fmu", "export", str(path), "--model", unit, "--fmi", _UNITS[unit])


def _record(run: Run, directory: Path) -> None:
    """Record a run in memory and one thread, or with `hil run` and two processes."""
    case, out = run.case, directory / run.name
    out.mkdir(parents=True)
    if run.unit:
        case = _changed(case, (("plant.model", f"fmu:{_unit_path(run.unit, directory)}"),))
    if not run.link:
        golden.record(scenario_for(case), out, case.orders)
        return
    settings = [part for key, value in case.changes for part in ("--set", f"{key}={value}")]
    _hil(
        "run", case.scenario, "--link", run.link, "--clock", "lockstep", "--no-report",
        "--out", str(out), *settings,
    )  # fmt: skip
    for name in golden.PROCESSES:
        if not (out / f"{name}.mcap").exists():
            raise RunError(f"{out}: no log of the {name}")


def _hil(*arguments: str) -> None:
    """Run a command as a user does, on a bus of its own; its verdict on the run does not count.

    Raises: RunError with its last words
    """
    with tempfile.TemporaryDirectory(prefix="hil-") as bus:
        done = subprocess.run(
            [sys.executable, "-m", "bench.cli", *arguments], capture_output=True, text=True,
            timeout=_TIMEOUT_S, check=False, env={**os.environ, "HIL_CAN_DIRECTORY": bus},
        )  # fmt: skip
    if done.returncode not in (0, 1) or "Traceback" in done.stderr:
        raise RunError((done.stderr or done.stdout).strip().splitlines()[-1])


def _verdict(a: Path, b: Path) -> str:
    """Say in one line whether two logs are the same, else where they part first."""
    for path in (a, b):
        if not path.exists():
            return f"{path} is missing"
    with logs.open(a) as left, logs.open(b) as right:
        found = compare(left, right, timing=True, left_out=_LEFT_OUT)
        lost, new = _lost(left, right), _lost(right, left)
    if lost:
        return f"lacks {', '.join(lost)}"
    if found.first is not None:
        return _parting(found)
    if not found.whole:
        return "differs: one has more ticks than the other"
    rows = sum(gap.common for gap in found.topics)
    more = f", new: {', '.join(new)}" if new else ""
    return f"same, {thousands(rows)} messages{more}"


def _lost(a: Log, b: Log) -> list[str]:
    """Return topics and fields of A that B has not."""
    lost = []
    for name, topic in a.topics.items():
        if name not in b.topics:
            lost.append(name)
            continue
        kept = {field.name for field in b.topics[name].fields}
        lost += [f"{name} {field.name}" for field in topic.fields if field.name not in kept]
    return lost


def _parting(found: Comparison) -> str:
    first = found.first
    assert first is not None
    topics = ", ".join(gap.topic for gap in found.topics if not gap.same)
    return (
        f"differs from tick {first.tick}: {first.topic} {first.field}: A {first.recorded!r:.60}, "
        f"B {first.replayed!r:.60}; in {topics}"
    )


def main(argv: list[str] | None = None) -> int:
    """Entry point of `python -m bench.dev.reference`."""
    parser = argparse.ArgumentParser(prog="python -m bench.dev.reference")
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record", help="record the runs")
    recording.add_argument("directory", type=Path)
    comparing = commands.add_parser("compare", help="compare two recordings")
    comparing.add_argument("first", type=Path)
    comparing.add_argument("second", type=Path)
    for command in (recording, comparing):
        command.add_argument("names", nargs="*", metavar="NAME", help="a pattern; all without")
    given = parser.parse_args(argv)
    if given.command == "record":
        return guarded(lambda: record(given.directory, given.names))
    return guarded(lambda: compare_all(given.first, given.second, given.names))


if __name__ == "__main__":
    sys.exit(main())
