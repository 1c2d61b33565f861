"""`hil bench soak`: the loop for a long time; memory, handles and the age of samples stay flat."""

from __future__ import annotations

import json
import os
import threading
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import hil.log
from bench.measure.latency import machine
from bench.run import directory, scenarios
from bench.run.directory import RunFiles
from bench.run.execution import execute, resolved
from bench.run.progress import view_for
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.errors import RunError
from hil.log.segments import segments_before
from hil.wire.commands import OperatorCommand, begun_at

WARM_UP_S: Final = 60.0
"""After this nothing may grow: the median of the last fifth of what follows against that of the
first. Of a shorter run the first half."""

MOST_GROWTH_BYTES: Final = 1 << 20
MOST_AGEING: Final = 0.1
"""Of a period: by so much samples may be older at the end than after warm-up."""

BIN_S: Final = 10.0
_LOOK_S: Final = 1.0
_START_S: Final = 10
_SEGMENT_BYTES: Final = 64 << 20  # what a recorder keeps of a file in memory grows with the file
_ROLES: Final = {"plant.main": "plant", "controller.main": "controller"}
_RECORDER: Final = "drivers.recorder.process"
Values = NDArray[np.float64]


class Look(NamedTuple):
    """One process at one instant."""

    t_s: float
    resident_bytes: int
    handles: int


class Ages(NamedTuple):
    """Medians of bins of the run: when, and how old things were.

    `sample_us` is the time from a sample's send to its use, less what it was in the first bin, as
    neither process knows when the other one's clock began; `answer_ticks` is how old the command
    was that acted; `unanswered` is the share of ticks for which there was none.
    """

    t_s: Values
    sample_us: Values
    answer_ticks: Values
    unanswered: Values


class Verdict(NamedTuple):
    """One thing that is to be flat."""

    what: str
    flat: bool
    text: str


class Watcher(threading.Thread):
    """Looks at all processes of a run once a second, from outside."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.looks: dict[str, list[Look]] = {}
        self._pid = pid
        self._start_s = time.monotonic()
        self._end = threading.Event()

    def run(self) -> None:
        """Look until the end."""
        while not self._end.wait(_LOOK_S):
            t_s = time.monotonic() - self._start_s
            for name, pid in processes_of(self._pid).items():
                look = look_at(pid, t_s)
                if look is not None:
                    self.looks.setdefault(name, []).append(look)

    def stop(self) -> None:
        """Look no more."""
        self._end.set()
        self.join()


def children_of(pid: int) -> list[int]:
    """Return the processes that a process has started and that still run."""
    found: list[int] = []
    for place in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += map(int, place.read_text().split())
        except OSError:
            continue  # a thread that ends is no news
    return found


def processes_of(pid: int) -> dict[str, int]:
    """Return plant, controller and their recorders below a process, by name."""
    found = {}
    for child in children_of(pid):
        name = next((role for module, role in _ROLES.items() if module in _words(child)), None)
        if name is None:
            continue
        found[name] = child
        for below in children_of(child):
            if _RECORDER in _words(below):
                found[f"{name} recorder"] = below
    return found


def _words(pid: int) -> list[str]:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    except OSError:
        return []


def look_at(pid: int, t_s: float) -> Look | None:
    """Return what a process holds now; None when it has ended."""
    place = Path(f"/proc/{pid}")
    try:
        lines = (place / "status").read_text().splitlines()
        handles = sum(1 for _ in (place / "fd").iterdir())
    except OSError:
        return None
    resident = next((line.split()[1] for line in lines if line.startswith("VmRSS:")), None)
    return None if resident is None else Look(t_s, int(resident) << 10, handles)


def ages(files: RunFiles, scenario: Resolved) -> Ages:
    """Read from both logs how old samples and answers were, in bins over the run."""
    wide = round(BIN_S * scenario.loop.rate_hz)
    sent = _binned(files.plant_log, wide)
    taken = _binned(files.controller_log, wide)
    rows = []
    for number in sorted(sent.keys() & taken.keys()):
        plant, controller = sent[number], taken[number]
        answered = plant["used_tick"] >= 0
        rows.append((
            number * BIN_S,
            _lag_us(controller, "woke_ns") - _lag_us(plant, "done_ns"),
            float(np.median((plant["tick"].astype(np.int64) - plant["used_tick"])[answered]))
            if answered.any() else np.nan,
            float(1.0 - answered.mean()),
        ))  # fmt: skip
    if not rows:
        raise RunError(f"{files.directory}: the logs have no tick in common")
    t_s, sample_us, answer, unanswered = np.array(rows).T
    return Ages(t_s, sample_us - sample_us[0], answer, unanswered)


def _binned(path: Path, wide: int) -> dict[int, NDArray[Any]]:
    """Read /timing of a log by bins of so many ticks; ticks that were skipped are left out."""
    parts: dict[int, list[NDArray[Any]]] = {}
    with hil.log.open(path) as log:
        for block in log.blocks("/timing"):
            ran = block[block["missed"] == 0]
            numbers = ran["tick"] // wide
            for number in np.unique(numbers):
                parts.setdefault(int(number), []).append(ran[numbers == number])
    return {number: np.concatenate(found) for number, found in parts.items()}


def _lag_us(timing: NDArray[Any], instant: str) -> float:
    """Median of an instant against the tick's own time [us]."""
    behind_ns = timing[instant].astype(np.int64) - timing["t_ns"].astype(np.int64)
    return float(np.median(behind_ns)) * 1e-3


def growth(values: Values) -> float:
    """Return by how much the median of the last fifth exceeds that of the first."""
    fifth = max(len(values) // 5, 1)
    return float(np.median(values[-fifth:]) - np.median(values[:fifth]))


def judge(looks: dict[str, list[Look]], aged: Ages, scenario: Resolved) -> list[Verdict]:
    """Say of everything whether it stayed flat after warm-up."""
    warm_s = min(WARM_UP_S, scenario.run.duration_s / 2.0)
    found = []
    for name, all_looks in looks.items():
        later = [look for look in all_looks if look.t_s >= warm_s]
        if later:
            found += _judge_process(name, later)
    ageing_us = growth(aged.sample_us[aged.t_s >= warm_s - BIN_S])
    most_us = MOST_AGEING * scenario.loop.period_ns * 1e-3
    return [
        *found,
        Verdict("sample age", ageing_us <= most_us,
                f"{ageing_us:+.0f} us since warm-up, accepted {most_us:+.0f}"),
        _judge_answers(aged),
    ]  # fmt: skip


def _judge_process(name: str, later: list[Look]) -> list[Verdict]:
    _, resident_bytes, handles = np.array(later, dtype=float).T
    grown, more = growth(resident_bytes), growth(handles)
    size = f"{resident_bytes[0] / 2**20:.1f} MiB after warm-up, {grown / 2**20:+.2f} since"
    return [
        Verdict(f"memory of {name}", grown <= MOST_GROWTH_BYTES, size),
        Verdict(f"handles of {name}", more <= 0.0, f"{handles[0]:.0f}, {more:+.0f} since"),
    ]


def _judge_answers(aged: Ages) -> Verdict:
    answers = aged.answer_ticks[~np.isnan(aged.answer_ticks)]
    if not len(answers):
        return Verdict("answer age", False, "no tick was answered")
    older = growth(answers)
    text = f"{np.median(answers):g} ticks, {older:+g} since warm-up; "
    text += f"{np.mean(aged.unanswered) * 100:.3f} % of ticks without one"
    return Verdict("answer age", older <= 0.0, text)


def endless(minutes: float, changes: list[tuple[str, Any]]) -> Scenario:
    """Return settled running for so long; an engine that a stall has stopped is started again.

    Raises: ConfigError
    """
    timed = [("loop.clock", "realtime"), ("run.duration_s", minutes * 60.0),
             ("log.segment_bytes", _SEGMENT_BYTES)]  # fmt: skip
    scenario = scenarios.read("steady", [*timed, *changes])
    often = range(_START_S, round(minutes * 60.0), _START_S)
    starts = {f"start-{at_s}": begun_at(float(at_s), OperatorCommand("start")) for at_s in often}
    return scenario.model_copy(update={"events": starts})


def run(minutes: float, changes: list[tuple[str, Any]], out: Path | None, *, force: bool) -> int:
    """Run, print the verdict, write soak.json and soak.png; 0 when everything was flat.

    The logs of a flat run are deleted: they take 25 MB a minute and have nothing to tell.

    Raises: HilError as a run does
    """
    with resolved(endless(minutes, changes)) as scenario:
        files = directory.prepare("soak", out, force=force)
        made = directory.claim("--out", files.directory, ("soak.json", "soak.png"), force=force)
        console = Console(highlight=False)
        watcher = Watcher(os.getpid())
        watcher.start()
        with view_for(scenario, console) as view:
            ended = execute(scenario, files, view)
        watcher.stop()
    if ended.error is not None:
        raise ended.error
    if ended.exit_code:
        return ended.exit_code
    aged = ages(files, scenario)
    verdicts = judge(watcher.looks, aged, scenario)
    told = as_tree(minutes, scenario, watcher.looks, aged, verdicts)
    made[0].write(json.dumps(told, indent=1))
    for verdict in verdicts:
        console.print(f"{'flat' if verdict.flat else 'NOT FLAT':9}{verdict.what}: {verdict.text}")
    from bench.measure.soak_plot import write_picture

    with made[1].writing() as beside:
        write_picture(told, beside)
    console.print(", ".join(str(file.path) for file in made))
    for log in (files.plant_log, files.controller_log) if told["flat"] else ():
        for path in (*segments_before(log), log):
            path.unlink()
    return 0 if told["flat"] else 1


def as_tree(
    minutes: float,
    scenario: Resolved,
    looks: dict[str, list[Look]],
    aged: Ages,
    verdicts: list[Verdict],
) -> dict[str, Any]:
    """Return everything as one tree for soak.json."""
    return {
        "minutes": minutes,
        "link": scenario.link.kind,
        "rate_hz": scenario.loop.rate_hz,
        "machine": machine(),
        "flat": all(verdict.flat for verdict in verdicts),
        "verdicts": [verdict._asdict() for verdict in verdicts],
        "processes": {
            name: {key: [getattr(look, key) for look in rows] for key in Look._fields}
            for name, rows in looks.items()
        },
        "ages": {key: [None if np.isnan(v) else v for v in values.tolist()]
                 for key, values in aged._asdict().items()},
    }  # fmt: skip
