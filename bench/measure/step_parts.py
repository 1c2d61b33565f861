"""The parts of a tick, each on its own: what it was given in a run, given to it again, many times.

A stopwatch around a part of a tenth of a microsecond tells mostly of itself, and compiled loops let
none in. So a process with interpreted loops notes what each part is called with, in some thousand
ticks of a run. Here, on loops as they were at its beginning, each part is called with that again,
one part after the other. The call from here is in the figure: some 50 ns for a compiled part.

python -m bench.measure.step_parts CHANGES OUT : note what the parts are called with
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

import controller.build
import plant.build
from bench.run import offline, scenarios
from bench.run.resolve import resolve
from drivers.links import open_memory
from drivers.recorder.client import NullRecorder
from hil import compiled
from hil.config.resolved import Resolved
from hil.errors import RunError
from hil.values import Value, fields_of

Changes = list[tuple[str, Any]]
Calls = dict[str, list[tuple[Any, ...]]]

WARM_UP: Final = 200
_TURNS: Final = 5
_OURS: Final = ("hil", "plant", "controller", "drivers")


class Part(NamedTuple):
    """A part of a tick, and the function that is it: where it is looked up, under which name."""

    name: str
    module: str
    function: str


PARTS: Final = (
    Part("plant: physics", "plant.loop", "step"),
    Part("plant: sensors", "plant.loop", "sample"),
    Part("plant: sensors", "plant.loop", "sensed"),
    Part("plant: decoding the answer", "plant.answers", "Answers.understand"),
    Part("plant: packing records", "plant.loop", "pack_turn"),
    Part("controller: decoding the sample", "controller.reception", "Reception.take"),
    Part("controller: layers", "controller.loop", "step"),
    Part("controller: messages of the answer", "controller.loop", "messages"),
    Part("controller: packing records", "controller.loop", "packed_tick"),
    Part("both: encoding", "hil.wire.codec", "Encoder.encode"),
)


class Pair(NamedTuple):
    """Both loops at the beginning of a run, on a memory link and without logs."""

    plant: Any
    controller: Any


def pair_of(scenario: Resolved) -> Pair:
    """Build both loops, joined."""
    ends = open_memory()
    plant_loop = plant.build.make_loop(scenario, ends[0], NullRecorder())
    answering = controller.build.make_loop(scenario, ends[1], NullRecorder())
    offline.join(ends[0].link, ends[1].link, answering)
    return Pair(plant_loop, answering)


def costs_us(changes: Changes, ticks: int, scratch: Path) -> dict[str, float]:
    """Return what each part takes of a tick, on average over the ticks behind the warm-up [us].

    Raises: RunError when the run whose calls are noted fails
    """
    path = scratch / "calls.pickle"
    _note(changes, path)
    scenario = resolve(scenarios.read("steady", changes))
    best: dict[str, float] = {}
    for _ in range(_TURNS):
        calls = _read(path, pair_of(scenario))
        gc.collect()
        gc.freeze()  # as in a run, where nothing is collected either
        gc.disable()
        for part in dict.fromkeys(part.name for part in PARTS):
            spent_us = sum(_spent_us(p, calls) for p in PARTS if p.name == part) / ticks
            best[part] = min(spent_us, best.get(part, spent_us))
    return best


def _note(changes: Changes, path: Path) -> None:
    """Have a process with interpreted loops note the calls."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", "bench.measure.step_parts", json.dumps(changes), str(path)],
        env={**os.environ, "HIL_COMPILED": "off", "PYTHONPATH": str(compiled.root())},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise RunError(f"the parts of a tick cannot be told: {done.stderr.strip()}")


def _spent_us(part: Part, calls: Calls) -> float:
    """The time of all calls of a part behind the warm-up, that of the loop taken off [us]."""
    function, given = _found(part), calls[f"{part.module}:{part.function}"]
    warm = len(given) * WARM_UP // (WARM_UP + _ticks_of(calls))
    for arguments in given[:warm]:
        function(*arguments)
    given, now = given[warm:], time.thread_time_ns
    start_ns = now()
    for arguments in given:
        function(*arguments)
    called_ns = now()
    for _ in given:
        pass
    return max(2 * called_ns - start_ns - now(), 0) * 1e-3


def _ticks_of(calls: Calls) -> int:
    return len(calls["controller.loop:step"]) - WARM_UP


def _found(part: Part) -> Callable[..., Any]:
    function: Any = importlib.import_module(part.module)
    for name in part.function.split("."):
        function = getattr(function, name)
    called: Callable[..., Any] = function
    return called


def _lasting(pair: Pair) -> dict[int, str]:
    """What a call may name instead of bringing it: the objects that the loops hold at first."""
    found: dict[int, str] = {}
    waiting: list[tuple[str, Any]] = list(pair._asdict().items())
    while waiting:
        path, holder = waiting.pop()
        names = fields_of(type(holder)) if isinstance(holder, Value) else vars(holder)
        for name in names:
            held = getattr(holder, name)
            if id(held) not in found and type(held).__module__.split(".")[0] in _OURS:
                found[id(held)] = f"{path}.{name}"
                if isinstance(held, Value) or hasattr(held, "__dict__"):
                    waiting.append((f"{path}.{name}", held))
    return found


def write_calls(changes: Changes, path: Path) -> None:
    """Run the loops and write what each part was called with."""
    scenario = resolve(scenarios.read("steady", changes))
    pair = pair_of(scenario)
    lasting = _lasting(pair)
    calls: Calls = {}
    for part in PARTS:
        _listen(part, calls.setdefault(f"{part.module}:{part.function}", []))
    offline.run_ticks(pair.plant, 0, scenario.ticks)
    with path.open("wb") as file:
        pickler = pickle.Pickler(file)
        pickler.persistent_id = lambda held: lasting.get(id(held))  # type: ignore[method-assign]
        pickler.dump(calls)


def _listen(part: Part, noted: list[tuple[Any, ...]]) -> None:
    """Have the calls of a part noted, from here on."""
    *owner, name = part.function.split(".")
    holder: Any = importlib.import_module(part.module)
    for outer in owner:
        holder = getattr(holder, outer)
    function = getattr(holder, name)

    def listening(*arguments: Any) -> Any:  # noqa: ANN401
        noted.append(arguments)
        return function(*arguments)

    setattr(holder, name, listening)


def _read(path: Path, pair: Pair) -> Calls:
    """Return the calls, for these loops."""
    with path.open("rb") as file:
        unpickler = pickle.Unpickler(file)
        unpickler.persistent_load = lambda path: attrgetter(path)(pair)  # type: ignore[method-assign]
        calls: Calls = unpickler.load()
    return calls


if __name__ == "__main__":
    write_calls([tuple(change) for change in json.loads(sys.argv[1])], Path(sys.argv[2]))
