"""A run continued from its recorded state with other parameters.

Both loops are brought to the chosen tick by their snapshots and the recorded inputs behind them,
exactly as they were; then the loop is closed again, in memory and lockstep, and goes its own way.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import controller.build
from bench.logs.replay.loops import ReplayedController, ReplayedPlant
from bench.logs.replay.replay import (
    NONE_GIVEN,
    OwnFiles,
    make,
    process_of,
    scenario_of,
    with_own,
)
from bench.logs.replay.turn import Turn
from bench.logs.replay.turns import check_layouts, turns
from bench.logs.what_if.changes import Changed, changed
from bench.run import directory as outdir
from bench.run import offline
from bench.run.directory import RunFiles
from controller.loop import ControllerLoop
from drivers.links import Connection, open_memory
from drivers.system.log import open_recorder
from hil import log as logs
from hil import snapshot
from hil.config.resolved import Resolved
from hil.errors import ConfigError, LogError
from hil.files import Output
from hil.log import Log, Span, topics
from hil.pacing import LockstepPacer
from hil.ports import Recorder
from hil.stimuli.player import player_of
from hil.values import NEVER
from plant.loop import PlantLoop

Loop = ReplayedPlant | ReplayedController


class Wish(NamedTuple):
    """What is asked for: from when on, with what changed, until when, written where."""

    start: str
    assignments: tuple[str, ...] = ()
    duration_s: float | None = None
    out: Path | None = None
    own: OwnFiles = NONE_GIVEN


class Told(NamedTuple):
    """What was done: both runs, from which tick on they differ, and what should be known."""

    recorded: Path
    continued: Path
    scenario: Resolved
    tick: int
    ticks: int
    notes: tuple[str, ...]


class Resumed(NamedTuple):
    """Both loops at the start of a tick, and the answer that is on its way to the plant."""

    tick: int
    plant: ReplayedPlant
    controller: ReplayedController
    in_flight: bytes
    notes: tuple[str, ...]


def tick_of(text: str, rate_hz: int) -> int:
    """Read an instant: 1.05s, 1.05 or tick:1050; a time means the first tick at or after it.

    Raises: ConfigError
    """
    try:
        if text.startswith("tick:"):
            tick = int(text.removeprefix("tick:"))
        else:
            tick = math.ceil(float(text.removesuffix("s")) * rate_hz - 1e-6)
    except (ValueError, OverflowError):
        tick = -1
    if tick < 1:
        raise ConfigError(f"--from {text!r}: accepted is a time after 0, as in 1.05s, or tick:1050")
    return tick


def continue_run(directory: Path, wish: Wish) -> Told:
    """Continue a run from its recorded state.

    Raises: LogError when its logs cannot be used, ConfigError when a change cannot be made
    """
    paths = (directory / "plant.mcap", directory / "controller.mcap")
    if wish.out is not None:
        _claim(wish.out)
    with logs.open(paths[0]) as plant_log, logs.open(paths[1]) as controller_log:
        scenario = with_own(controller_log, scenario_of(plant_log, own=wish.own), wish.own)
        tick = tick_of(wish.start, scenario.loop.rate_hz)
        resumed = resume((plant_log, controller_log), scenario, tick)
        state = resumed.plant.loop.state
        wanted = changed(scenario, wish.assignments, wish.duration_s, tick, state)
    out = wish.out or _fresh(directory)
    _go_on(resumed, wanted, directory, out)
    ticks = wanted.scenario.ticks - tick
    return Told(directory, out, wanted.scenario, tick, ticks, resumed.notes + wanted.notes)


def _claim(out: Path) -> None:
    """Refuse a directory that holds a run, or cannot be written.

    Raises: ConfigError
    """
    if earlier := RunFiles(out).existing():
        raise ConfigError(
            f"--out {out}: holds a run ({earlier[0].name}); accepted is another directory"
        )
    outdir.check_directory("--out", out)


def _fresh(directory: Path) -> Path:
    """Return a directory inside the run's that does not exist yet."""
    number = 1
    while (out := directory / f"what-if-{number}").exists():
        number += 1
    return out


def resume(both: tuple[Log, Log], scenario: Resolved, tick: int) -> Resumed:
    """Bring both loops to the start of a tick, as they were then.

    Raises: LogError when the logs do not reach it
    """
    notes: list[str] = []
    plant_loop, _ = _brought_to(both[0], "plant", scenario, tick, notes)
    controller_loop, in_flight = _brought_to(both[1], "controller", scenario, tick, notes)
    assert isinstance(plant_loop, ReplayedPlant)
    assert isinstance(controller_loop, ReplayedController)
    if plant_loop.next_tick() != tick:
        raise both[0].error(f"ends before tick {tick}, or skipped it")
    if scenario.loop.clock == "realtime":
        notes.append("recorded in real time, continued in lockstep: every answer comes in time")
    return Resumed(tick, plant_loop, controller_loop, in_flight, tuple(notes))


def _brought_to(
    log: Log, process: str, scenario: Resolved, tick: int, notes: list[str]
) -> tuple[Loop, bytes]:
    """Run one loop on its recorded turns up to a tick; return it and what it sent last."""
    if process_of(log) != process:
        raise log.error(f"is no log of the {process}")
    check_layouts(log)
    loop = make(process, scenario)
    period_ns = scenario.loop.period_ns
    # Not that of the tick itself: the answer that is on its way is of the turn before.
    found = _last_snapshot(log, (tick - 1) * period_ns)
    if found is None and log.continues:
        raise log.error(f"has no snapshot before tick {tick}")
    if found is not None and not _resumed(log, loop, found.state):
        notes.append(f"{process}: snapshots of another version, so replayed from the start")
        loop, found = make(process, scenario), None
    start = 0 if found is None else found.tick
    span = Span(max((start - 1) * period_ns, 0), (tick + 1) * period_ns)
    if not _play(log, loop, turns(log, process, span), (start, tick)):
        notes.append(f"the {process} of today does not repeat the recording up to tick {tick}")
    return loop, loop.tape.sent


def _resumed(log: Log, loop: Loop, state: str) -> bool:
    """Set a loop to a snapshot; False when that is of another version and not needed.

    Raises: LogError when there is no other way
    """
    try:
        loop.resume(state)
    except LogError as error:
        if log.continues:
            raise log.error(str(error)) from None
        return False
    return True


def _play(log: Log, loop: Loop, recorded: Iterator[Turn], between: tuple[int, int]) -> bool:
    """Run the turns from one tick up to another; whether all put what they put then.

    Raises: LogError when ticks are missing
    """
    start, end = between
    same = True
    for turn in recorded:
        if turn.tick >= end:
            break
        is_note = turn.first_tick < 0
        if turn.tick < start if not is_note else loop.next_tick() <= start:
            continue
        if not is_note and turn.first_tick != loop.next_tick() >= 0:
            raise log.error(f"ticks are missing between {loop.next_tick()} and {end}")
        same = loop.turn(turn) == turn.recorded and same
    return same


def _last_snapshot(log: Log, t_ns: int) -> Any:  # noqa: ANN401
    """Return the newest snapshot that is not after an instant."""
    if "/snapshot" not in log.topics:
        return None
    for reach_ns in (1_000_000_000, t_ns):
        found = log.records("/snapshot", Span(max(t_ns - reach_ns, 0), t_ns))
        last = deque(found, maxlen=1)
        if last:
            return last[0]
    return None


def _go_on(resumed: Resumed, wanted: Changed, of: Path, out: Path) -> None:
    """Close the loop and run it to its end.

    Raises: ConfigError when the directory cannot be written
    """
    outdir.make_directory("--out", out)
    text = wanted.scenario.model_dump_json(indent=1)
    Output("--out", out / "scenario.json").write(text)
    more = {"continues": {"of": str(of), "tick": str(resumed.tick), **wanted.told}}
    with contextlib.ExitStack() as stack:
        recorders: dict[str, Any] = {}
        for name in ("plant", "controller"):
            recorder = open_recorder(out / f"{name}.mcap", wanted.scenario, name, more)
            stack.callback(recorder.close)
            recorders[name] = recorder
        plant_loop = _closed(resumed, wanted, recorders)
        tick, ticks = resumed.tick, wanted.scenario.ticks
        while tick < ticks:
            tick = plant_loop.turn(tick)


def _closed(resumed: Resumed, wanted: Changed, recorders: dict[str, Recorder]) -> PlantLoop:
    """Join both loops in memory, with the changed parameters and the state that they had."""
    plant_end, controller_end = open_memory()
    scenario = wanted.scenario
    plant_loop = _plant(resumed, wanted, plant_end, recorders["plant"])
    controller_loop = _controller(resumed, wanted, controller_end, recorders["controller"])
    controller_end.link.send(resumed.in_flight)
    offline.join(plant_end.link, controller_end.link, controller_loop)
    for loop, side in ((plant_loop, "plant."), (controller_loop, "controller.")):
        own = {key: value for key, value in wanted.live.items() if key.startswith(side)}
        if own:
            loop.plan(resumed.tick, own, "what-if")
    t_ns = resumed.tick * scenario.loop.period_ns
    for name, memory in (
        ("plant", plant_loop.remember()),
        ("controller", controller_loop.remember()),
    ):
        text = snapshot.dumps(memory)
        recorders[name].put(topics.SNAPSHOT.pack(resumed.tick, t_ns, text))
    return plant_loop


def _plant(resumed: Resumed, wanted: Changed, end: Connection, recorder: Recorder) -> PlantLoop:
    scenario = wanted.scenario
    pacer = LockstepPacer(scenario.loop.period_ns, round(scenario.loop.peer_timeout_s * 1e9))
    memory = resumed.plant.loop.remember()
    loop = PlantLoop(
        wanted.plant_params, memory.state, link=end.link, pacer=pacer, recorder=recorder,
        status=end.status, status_every=NEVER,
        snapshot_every=scenario.loop.snapshot_every, player=player_of(scenario, "plant"),
    )  # fmt: skip
    loop.recall(memory)
    return loop


def _controller(
    resumed: Resumed, wanted: Changed, end: Connection, recorder: Recorder
) -> ControllerLoop:
    scenario = wanted.scenario
    pacer = LockstepPacer(scenario.loop.period_ns, round(scenario.loop.peer_timeout_s * 1e9))
    loop = controller.build.make_loop(scenario, end, recorder, pacer)
    loop.recall(resumed.controller.loop.remember())
    return loop
