"""A running engine as the panel knows it: its records, its status, its commands, its verdict."""

from __future__ import annotations

import asyncio
import json
import sys
import time
from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import Any, Final, NamedTuple

from bench.live.taps import SIDES, Taps
from bench.panel import signals, steering, tuning
from bench.panel.feed import Word, taken
from bench.panel.memory import Memory
from bench.panel.steering import Steering
from bench.panel.viewers import Audience, Viewer
from bench.run.directory import RunFiles
from drivers.links import open_operator
from drivers.zenoh.channels import ZenohOperator
from drivers.zenoh.sockets import records_socket
from hil.config.base import value_of
from hil.config.resolved import Resolved
from hil.names import parameters
from hil.names.leaves import Parameter
from hil.wire.busload import BITS_MAX

_LOOK_S: Final = 0.02
_STATUS_S: Final = 0.2
_JOIN_S: Final = 0.5
_WORDS: Final = 400


class Subject(NamedTuple):
    """Which engine: its configuration, and the directory of its run if it has one."""

    scenario: Resolved
    files: RunFiles | None


class Session:
    """Follows one engine and tells the audience."""

    def __init__(self, subject: Subject, operator: ZenohOperator | None, steers: Steering) -> None:
        self.subject = subject
        self.audience = Audience()
        self.steering = steers
        self.memory = Memory(subject.scenario.loop.rate_hz)
        self._operator = operator
        self._taps = Taps(partial(records_socket, subject.scenario.link.zenoh))
        self._words: deque[Word] = deque(maxlen=_WORDS)
        self._statuses: dict[str, Mapping[str, Any]] = {}
        self._verdict: dict[str, Any] | None = None
        self._frames = 0
        self._t_s = 0.0
        self._tasks: list[asyncio.Task[None]] = []

    def begin(self) -> None:
        """Begin to follow."""
        work = [self._follow_records(), self._follow_status(), self._follow_presence()]
        if self.subject.files is not None:
            work.append(self._follow_verdict(self.subject.files))
        self._tasks = [asyncio.create_task(task) for task in work]

    async def end(self) -> None:
        """Leave."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._taps.close()
        if self._operator is not None:
            await asyncio.to_thread(self._operator.close)

    def greet(self, viewer: Viewer) -> None:
        """Tell a new viewer all that it has to know."""
        viewer.tell({
            "k": "hello",
            "engine": _facts(self.subject),
            "signals": signals.listed(),
            "commands": steering.offered(),
            "parameters": [p.table() for p in _live(self.subject.scenario)],
            "steerable": self.steering.is_possible,
        })  # fmt: skip
        viewer.tell(self._values())
        viewer.tell({"k": "words", "words": [word._asdict() for word in self._words]})
        if self._verdict is not None:
            viewer.tell({"k": "verdict", **self._verdict})

    def _values(self) -> dict[str, Any]:
        undoable = len(self.steering.undoable)
        return {"k": "values", "values": self.steering.values, "undoable": undoable}

    def tell_values(self) -> None:
        """Tell all what the parameters are."""
        self.audience.tell(self._values())

    async def _follow_records(self) -> None:
        while True:
            for side, tap, data in self._taps.take():
                batch = taken(data, side, tap.topics)
                self._notice_beginning(batch.rows)
                for key, rows in batch.rows.items():
                    self.memory.append(key, rows)
                self._frames += batch.frames
                if batch.words:
                    self._words.extend(batch.words)
                    words = [word._asdict() for word in batch.words]
                    self.audience.tell({"k": "words", "words": words})
            await asyncio.sleep(_LOOK_S)

    def _notice_beginning(self, rows: Mapping[str, Any]) -> None:
        """A time that goes back is another run."""
        if "plant.timing" in rows:
            t_s = float(rows["plant.timing"]["t_ns"][-1]) * 1e-9
            if t_s < self._t_s - 1.0:
                self.memory.forget()
                self.audience.tell({"k": "begun"})
            self._t_s = t_s

    async def _follow_presence(self) -> None:
        """Join recorders that appear; hear the parameters when they have changed."""
        heard: object = None
        while True:
            new = self._taps.join()
            changes = tuple(self._statuses.get(side, {}).get("changes") for side in SIDES)
            if new or (changes != heard and self._statuses):
                heard = changes
                if await self.steering.look():
                    self.tell_values()
            await asyncio.sleep(_JOIN_S)

    async def _follow_status(self) -> None:
        since_s, frames = time.monotonic(), self._frames
        bus: float | None = None
        while True:
            while self._operator is not None and (told := self._operator.poll_status()) is not None:
                self._statuses[told[0]] = told[1]
            elapsed_s = time.monotonic() - since_s
            if elapsed_s >= 1.0:
                bus = self._share_of_bus(self._frames - frames, elapsed_s)
                since_s, frames = time.monotonic(), self._frames
            self.audience.tell({
                "k": "status", "present": sorted(self._taps.present), "bus": bus,
                "lost": self._taps.lost, **self._statuses,
            })  # fmt: skip
            await asyncio.sleep(_STATUS_S)

    def _share_of_bus(self, frames: int, elapsed_s: float) -> float:
        """At most: every frame stuffed as much as can be."""
        return frames * BITS_MAX / (elapsed_s * self.subject.scenario.link.bitrate_bit_s)

    async def _follow_verdict(self, files: RunFiles) -> None:
        """Hear what a judge in a process of its own makes of the logs so far."""
        child = await asyncio.create_subprocess_exec(
            sys.executable, "-P", "-m", "bench.panel.judge", str(files.directory),
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
        assert child.stdout is not None
        try:
            while line := await child.stdout.readline():
                self._verdict = json.loads(line)
                self.audience.tell({"k": "verdict", **json.loads(line)})
        finally:
            if child.returncode is None:
                child.terminate()
                await child.wait()


def opened(subject: Subject) -> Session:
    """Join an engine.

    Raises: ConfigError, LinkError when its session does not open
    """
    operator, scenario = None, subject.scenario
    begun = {p.key: value_of(scenario, p.key) for p in _live(scenario)}
    if subject.scenario.link.kind != "memory":
        operator = open_operator(subject.scenario.link, subject.scenario.loop, "hil panel")
    return Session(
        subject, operator, Steering(operator, tuning.set_values, tuning.get_values, begun)
    )


def _live(scenario: Resolved) -> list[Parameter]:
    live = [p for p in parameters.parameters().values() if p.live]
    return [*live, *parameters.settings(scenario)]


def _facts(subject: Subject) -> dict[str, Any]:
    """What a page draws with."""
    scenario = subject.scenario
    prototype = scenario.plant.resolved_prototype()
    return {
        "name": scenario.name,
        "description": scenario.description,
        "model": scenario.plant.model,
        "link": scenario.link.kind,
        "clock": scenario.loop.clock,
        "rate_hz": scenario.loop.rate_hz,
        "head_mm": prototype.half_stroke_m * 1e3,
        "area_cm2": prototype.area_m2 * 1e4,
        "directory": "" if subject.files is None else str(subject.files.directory),
    }
