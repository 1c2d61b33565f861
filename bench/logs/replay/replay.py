"""Replay: a recorded run through the loops as they are today, compared byte by byte.

The inputs of every turn (batches, commands, instants) are in the log, so the loop that took them
then takes them now, and what it puts must be what was put. Only where bytes differ are records
decoded, and then compared field by field.
"""

from __future__ import annotations

import gc
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from bench.logs.replay.differences import Records, differences_of
from bench.logs.replay.loops import LOOPS, Replayed, ReplayedController, ReplayedPlant
from bench.logs.replay.outcome import Found, Gap, Outcome
from bench.logs.replay.rig import replay_rig
from bench.logs.replay.turn import Turn
from bench.logs.replay.turns import check_layouts, turns
from hil import log as logs
from hil.config.check import check_json
from hil.config.resolved import Resolved
from hil.errors import ConfigError, HilError, LogError
from hil.log import Log, Span
from hil.log.part import ALWAYS
from hil.log.records import FORMAT

WINDOW_S = 0.15
"""How much about the first difference is kept, to show the strokes around it."""


class OwnFiles(NamedTuple):
    """Files of the law and the engine that a run was of, where its user had brought them.

    They are given, since what a log names is never loaded by itself.
    """

    law: Path | None = None
    engine: Path | None = None


NONE_GIVEN = OwnFiles()


def scenario_of(log: Log, config: Path | None = None, own: OwnFiles = NONE_GIVEN) -> Resolved:
    """Return the configuration of a log: its own, or that of a file.

    Raises: LogError when it has none that this version can read, or is of an older format
    """
    if log.format is not None and log.format < FORMAT:
        text = f"it is of log format {log.format}; this version replays {FORMAT}"
        raise log.error(f"cannot be replayed: {text} (`hil info` and `hil export` read it)")
    if config is not None:
        from bench.run.resolve import resolve
        from hil.config.load import read_scenario

        return resolve(read_scenario(config))
    attached = log.attachments.get("scenario.json")
    if attached is None:
        raise log.error("cannot be replayed: it carries no scenario.json; give one with --config")
    try:
        scenario = check_json(Resolved, attached.content, f"{log.path}: scenario.json")
    except ConfigError as error:
        raise LogError(str(error)) from None
    return with_own(log, scenario, own)


def with_own(log: Log, scenario: Resolved, own: OwnFiles) -> Resolved:
    """Put the files that were given into the places of those that a log's process has loaded.

    Raises: LogError when one is needed and was not given
    """
    process = log.metadata.get("run", {}).get("process")
    plant, controller = scenario.plant, scenario.controller
    changes: dict[str, Any] = {}
    if controller.own.file and process != "plant":
        told = f"a law of its user's, {controller.name} (SHA-256 {controller.own.sha256})"
        file = _given(log, own.law, told, "--controller")
        section = controller.own.model_copy(update={"file": file})
        changes["controller"] = controller.model_copy(update={"own": section})
    if plant.own.file and process != "controller":
        told = f"an engine of its user's, {plant.model} (SHA-256 {plant.own.sha256})"
        file = _given(log, own.engine, told, "--model")
        engine = plant.own.model_copy(update={"file": file})
        changes["plant"] = plant.model_copy(update={"own": engine})
    return scenario.model_copy(update=changes)


def _given(log: Log, file: Path | None, what: str, option: str) -> str:
    if file is None:
        raise log.error(f"is of {what}: give its file with {option}")
    return str(file)


def process_of(log: Log) -> str:
    """Return which process wrote a log.

    Raises: LogError when it does not say
    """
    process = log.metadata.get("run", {}).get("process", "")
    if process not in LOOPS:
        raise log.error("cannot be replayed: it does not say whether plant or controller wrote it")
    return process


def replay(log: Log, scenario: Resolved, span: Span = ALWAYS) -> Outcome:
    """Replay a log of ours from its beginning, or from the last snapshot before the span.

    Raises: LogError when it lacks what a replay needs
    """
    process = process_of(log)
    check_layouts(log)
    comparison = _Comparison(log, make(process, scenario), scenario.loop.rate_hz)
    start = _start(log, span)
    if start is not None:
        comparison.resume_at = start
    back_ns = 2 * scenario.loop.period_ns  # the turn that ends with the snapshot begins earlier
    reading = Span(0 if start is None else max(start - back_ns, 0), span.end_ns)
    with _without_collector():
        before_s = time.process_time()
        comparison.run(turns(log, process, reading), span)
        cpu_s = time.process_time() - before_s
    return comparison.outcome(process, scenario.loop.rate_hz, cpu_s)


def make(process: str, scenario: Resolved) -> ReplayedController | ReplayedPlant:
    """Make the loop of a process with the configuration of a log.

    Raises: LogError when it cannot be made any more
    """
    try:
        return LOOPS[process](scenario)
    except ConfigError as error:
        raise LogError(f"cannot be replayed: {error}") from None


def _start(log: Log, span: Span) -> int | None:
    """Return the instant of the last snapshot before the span; None: from the first record."""
    if span.start_ns <= 0 and not log.continues:
        return None
    instants = [record.t_ns for record in _snapshots(log, span)]
    if not instants and log.continues:
        raise log.error("cannot be replayed: its beginning is missing and it has no snapshot")
    return instants[-1] if instants else None


def _snapshots(log: Log, span: Span) -> Iterator[Any]:
    """Yield the snapshots up to the start of a span, or the first one of all."""
    if "/snapshot" not in log.topics:
        return
    if log.continues and span.start_ns <= 0:
        yield from (record for _, record in zip(range(1), log.records("/snapshot"), strict=False))
        return
    # Snapshots come often: the last one before an instant is no further away than this.
    for reach_ns in (10**9, 10**10, span.start_ns):
        near = Span(max(span.start_ns - reach_ns, 0), span.start_ns)
        found = list(log.records("/snapshot", near))
        if found:
            yield from found[-1:]
            return


class _without_collector:  # noqa: N801  # reads as a statement
    """No garbage collection meanwhile: a replay makes no cycles, as the loops do not."""

    def __enter__(self) -> None:
        gc.collect()
        gc.freeze()
        gc.disable()

    def __exit__(self, *_: object) -> None:
        gc.enable()
        gc.unfreeze()


class _Comparison:
    """Turns in, verdict out; keeps no more than a window of turns."""

    def __init__(self, log: Log, loop: Replayed, rate_hz: int) -> None:
        self.log = log
        self.loop = loop
        self.resume_at: int | None = None
        self.first = -1
        self.ticks = self.different = 0
        self.found: Found | None = None
        self.gaps: list[Gap] = []
        self.notes: list[str] = []
        self.records = Records(log)
        width = max(round(WINDOW_S * rate_hz), 1)
        self._before: deque[tuple[bytes, bytes]] = deque(maxlen=width)
        self._width = width
        self._cut: tuple[Turn, bytes] | None = None
        self._period_ns = round(1e9 / rate_hz)

    def run(self, recorded: Iterator[Turn], span: Span) -> None:
        """Replay all turns; where ticks are missing, go on from the next snapshot."""
        waiting = self.resume_at is not None
        for turn in recorded:
            if waiting:
                waiting = not self._resumed(turn)
                continue
            if turn.tick * self._period_ns > span.end_ns:
                break
            if turn.first_tick >= 0 and turn.first_tick != self.loop.next_tick() >= 0:
                self.gaps.append(Gap(self.loop.next_tick(), -1))
                waiting = not self._resumed(turn)
                continue
            self._compare(turn)

    def _resumed(self, turn: Turn) -> bool:
        """Go on from the snapshot of this turn, if it has one and it is not too early."""
        if turn.snapshot is None:
            return False
        next_tick, state = turn.snapshot
        if self.resume_at is not None and next_tick * self._period_ns < self.resume_at:
            return False
        try:
            self.loop.resume(state)
        except LogError as error:
            raise self.log.error(f"cannot be replayed from tick {next_tick}: {error}") from None
        self.resume_at = None
        if self.gaps and self.gaps[-1].next_tick < 0:
            self.gaps[-1] = Gap(self.gaps[-1].first_tick, next_tick)
        return True

    def _compare(self, turn: Turn) -> None:
        """Run one turn and compare what it puts with what it put then."""
        replayed = self.loop.turn(turn)
        if turn.tick >= 0:
            self.first = turn.first_tick if self.first < 0 else self.first
            self.ticks += turn.tick - turn.first_tick + 1
        if self._cut is not None:
            self._differ(*self._cut)
            self._cut = None
        if replayed != turn.recorded:
            if replayed.startswith(turn.recorded):
                self._cut = (turn, replayed)  # no difference if the log ends here
            else:
                self._differ(turn, replayed)
        if self.found is None:
            self._before.append((turn.recorded, replayed))
        elif len(self.found.around) < 2 * self._width:
            around = (*self.found.around, (turn.recorded, replayed))
            self.found = self.found._replace(around=around)

    def _differ(self, turn: Turn, replayed: bytes) -> None:
        """Decode what differs; it may be no more than fields that only one side has."""
        found = differences_of(self.records, turn, replayed)
        if found:
            self.different += 1
            if self.found is None:
                self.found = Found(found[0].tick, tuple(found), tuple(self._before))

    def outcome(self, process: str, rate_hz: int, cpu_s: float) -> Outcome:
        """Return the verdict."""
        if not self.ticks:
            raise self.log.error("has no tick that could be replayed")
        if self._cut is not None:
            self.notes.append(f"the records of tick {self._cut[0].tick}, the last, are cut off")
        return Outcome(
            process, self.first, self.ticks, self.different, self.found, tuple(self.gaps),
            (*self.notes, *self.records.notes()), self.ticks / rate_hz, cpu_s,
        )  # fmt: skip


def replay_file(path: Path, config: Path | None, span: Span, own: OwnFiles = NONE_GIVEN) -> Outcome:
    """Replay a log, whichever topics it has.

    Raises: HilError with exit code 2 when it cannot be used
    """
    with logs.open(path) as log:
        scenario = scenario_of(log, config, own)
        try:
            if "/frames/received" not in log.topics:
                return replay_rig(log, scenario, span)
            return replay(log, scenario, span)
        except LogError:
            raise
        except HilError as error:
            raise log.error(f"cannot be replayed: {error}") from None
