"""Plant and controller in this thread, in lockstep over memory: stepped by whoever holds them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Final

import controller.build
import plant.build
from bench.run import offline
from bench.run.checks.signals import Source, source_of
from controller.loop import ControllerLoop
from drivers.channels import MemoryCommands
from drivers.links import Connection, open_memory
from drivers.recorder.client import NullRecorder
from drivers.system.log import open_inline
from hil.config.resolved import Resolved
from hil.errors import ConfigError
from hil.log.records import MESSAGE_HEAD, PAYLOAD_OFFSET
from hil.log.topics import EVERY
from hil.ports import Recorder
from plant.loop import PlantLoop

SIDES: Final = ("plant", "controller")

_KEPT: Final = 512
"""Ticks that are looked through for what a topic said last: some strokes at any rate."""

_LENGTH_BYTES: Final = 9  # opcode and length, which the length of a record does not count


class Newest(Recorder):
    """Keeps what each topic said last, on the way to the log."""

    def __init__(self, log: Recorder) -> None:
        self._put = log.put
        self._data: deque[bytes] = deque(maxlen=_KEPT)

    def put(self, data: bytes, /) -> None:
        """Take the packed records of one tick."""
        self._data.append(data)
        self._put(data)

    def value(self, source: Source) -> float:
        """Return the newest value of a signal; nan where the last ticks have none."""
        declared = next(one for one in EVERY if one.name == source.topic)
        for data in reversed(self._data):
            if (payload := _last_payload(data, declared.channel_id)) is not None:
                values = declared.layout.unpack(payload)
                names = [each.name for each in declared.layout.fields]
                value = values[names.index(source.field)]
                return float(value if source.item is None else value[source.item])
        return math.nan


def _last_payload(data: bytes, channel: int) -> bytes | None:
    """Return what the last record of a channel carries."""
    found, offset = None, 0
    while offset < len(data):
        _, length, number, *_ = MESSAGE_HEAD.unpack_from(data, offset)
        end = offset + _LENGTH_BYTES + length
        if number == channel:
            found = data[offset + PAYLOAD_OFFSET : end]
        offset = end
    return found


def _recorder(scenario: Resolved, directory: Path | None, side: str, opened: ExitStack) -> Recorder:
    if directory is None:
        return NullRecorder()
    log = open_inline(directory / f"{side}.mcap", scenario, side)
    opened.callback(log.close)
    return log


class Pair:
    """Both loops of a scenario; `advance` steps them.

    With a directory both logs are written into it, and are whole once the pair is closed. `value`
    tells the newest value of any signal.

    plant, controller: the loops; `plant.state` and `controller.state` are what they remember
    tick: the one that comes next
    """

    def __init__(self, scenario: Resolved, directory: Path | None = None) -> None:
        self.scenario = scenario
        self.tick = 0
        self._stack = ExitStack()
        self._ends: tuple[Connection, Connection] = open_memory()
        with ExitStack() as opened:
            self._newest = {side: Newest(_recorder(scenario, directory, side, opened))
                            for side in SIDES}  # fmt: skip
            plant_end, controller_end = self._ends
            self.plant: PlantLoop = plant.build.make_loop(
                scenario, plant_end, self._newest["plant"]
            )
            self.controller: ControllerLoop = controller.build.make_loop(
                scenario, controller_end, self._newest["controller"]
            )
            offline.join(plant_end.link, controller_end.link, self.controller)
            self._stack = opened.pop_all()

    def __enter__(self) -> Pair:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self.close()

    @property
    def t_s(self) -> float:
        """Time of the tick that comes next [s]."""
        return self.tick * self.scenario.loop.period_ns * 1e-9

    def advance(self, ticks: int = 1) -> int:
        """Run so many ticks; return the one that comes next."""
        self.tick = offline.run_ticks(self.plant, self.tick, self.tick + ticks)
        return self.tick

    def advance_to(self, t_s: float) -> int:
        """Run up to a time of the run [s]; return the tick that comes next."""
        return self.advance(max(round(t_s * self.scenario.loop.rate_hz) - self.tick, 0))

    def order(self, command: Mapping[str, object], origin: str = "api") -> None:
        """Put a command on the command key, which both sides read (docs/commands.md)."""
        for end in self._ends:
            assert isinstance(end.commands, MemoryCommands)
            end.commands.submit(origin, command)

    def value(self, signal: str) -> float:
        """Return the newest logged value of a signal; nan while there is none.

        Raises: ConfigError when there is no such signal
        """
        named = source_of(signal)
        if named.side not in self._newest:
            raise ConfigError(f"signal {signal!r}: known at the end of a run only")
        return self._newest[named.side].value(named)

    def close(self) -> None:
        """Finish the logs."""
        self._stack.close()
