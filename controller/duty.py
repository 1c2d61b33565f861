"""The controller as a service: what the engine was asked to do survives a restart.

With `safety.rearm` a controller that is killed while the engine runs comes back with the duty of
its predecessor: it asks for a start and the set point that was in force, as an operator would, and
the mode table decides what becomes of it. Without it that is the operator's to do. One that was
stopped, or had gone to its safe state, stays off.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from controller.loop import ControllerLoop
from controller.mode.start_restart import Mode
from hil.errors import ConfigError
from hil.ports import CommandSource
from hil.wire.answers import STOPS
from hil.wire.commands import OperatorCommand, parse, write

RUNNING = (Mode.MOTORING, Mode.GENERATING)
RESUME_TRIES = 20
"""One at each look after the loop: for a second, at twenty looks a second."""


class Heart(Protocol):
    """What tells a service manager that the loop is alive."""

    next_tick: int

    def start(self, tick: int) -> None:
        """Begin to beat with the tick from which the loop runs."""

    def beat(self, tick: int, answered: bool, describe: Callable[[], str]) -> bool:
        """Feed the watchdog, tell the status; returns whether a reload was asked for."""


class Caretaker(Protocol):
    """What a service keeps for this process beyond its end, and hands in while it runs."""

    def kept(self) -> Mapping[str, Any]:
        """Return what a predecessor kept."""

    def keep(self, facts: Mapping[str, Any]) -> None:
        """Keep these facts for a successor; as cheap as a store to memory."""

    def prepared(self) -> bytes | None:
        """Return the set points that a reload has prepared."""


class DutyCommands(CommandSource):
    """A command source that speaks for the service itself first, then passes another one on."""

    def __init__(self, source: CommandSource) -> None:
        self.stopped = False
        self._source = source
        self._waiting: deque[tuple[str, bytes]] = deque()
        self._is_own = False  # whether the service itself asked last

    @property
    def idle(self) -> bool:
        """Whether everything that the service submitted was taken."""
        return not self._waiting

    def submit(self, origin: str, raw: bytes) -> None:
        """Hand over a command of the service's own."""
        self._waiting.append((origin, raw))

    def poll(self) -> tuple[str, bytes] | None:
        """Return (origin, raw command) of the oldest command not yet taken, or None."""
        self._is_own = bool(self._waiting)
        received = self._waiting.popleft() if self._is_own else self._source.poll()
        if received is not None:
            self._note(*received)
        return received

    def answer(
        self, is_taken: bool, tick: int, text: str, values: Mapping[str, Any] | None = None, /
    ) -> None:
        """Answer an operator; the service itself looks at the mode."""
        if not self._is_own:
            self._source.answer(is_taken, tick, text, values)

    def _note(self, origin: str, raw: bytes) -> None:
        """Remember a stop."""
        try:
            command = parse(raw, origin)
        except ConfigError:
            return  # the loop refuses it and says so
        if command is None:
            return  # the plant's
        self.stopped = self.stopped or command.kind in STOPS


class Resumption:
    """Asks for what the predecessor was doing, until the engine does it.

    A process that has just begun misses ticks, and the mode table starts nothing on stale samples:
    so it asks only while samples are fresh, again a few times, and not after an operator's stop.
    """

    def __init__(self, kept: Mapping[str, Any], rearm: bool) -> None:
        self.tries_left = RESUME_TRIES if rearm and kept.get("running") is True else 0
        names = ("tdc_ref_m", "target_power_w")
        self._set_point = {name: kept[name] for name in names if kept.get(name) is not None}

    def attend(self, mode: Mode, commands: DutyCommands, *, stale: int) -> None:
        """Ask, if it is still to be asked and can be answered; `stale` ticks had no sample."""
        if mode in RUNNING or commands.stopped:
            self.tries_left = 0
        if not self.tries_left or stale or not commands.idle:
            return
        if self.tries_left == RESUME_TRIES and self._set_point:
            commands.submit("resume", write(OperatorCommand("set-point", self._set_point)))
        self.tries_left -= 1
        commands.submit("resume", write(OperatorCommand("start")))


class Duty:
    """Looks after one loop between its ticks."""

    def __init__(
        self, heart: Heart, caretaker: Caretaker, source: CommandSource, rearm: bool
    ) -> None:
        self.commands = DutyCommands(source)
        self._resumption = Resumption(caretaker.kept(), rearm)
        self._heart = heart
        self._caretaker = caretaker

    @property
    def next_tick(self) -> int:
        """The tick from which on `attend` is due."""
        return self._heart.next_tick

    def begin(self, loop: ControllerLoop) -> None:
        """Begin with the first tick."""
        self._heart.start(loop.tick)

    def attend(self, loop: ControllerLoop) -> None:
        """Feed the watchdog, keep the duty, take new set points."""
        state = loop.state
        self._resumption.attend(state.mode, self.commands, stale=state.stale)
        target = state.set_points.target
        facts = {
            "running": state.mode in RUNNING or self._resumption.tries_left > 0,
            "tdc_ref_m": state.set_points.tdc_ref_m,
            "target_power_w": None if target is None else target.asked_w,
        }
        self._caretaker.keep(facts)
        answered = state.stale == 0
        if self._heart.beat(loop.tick, answered, lambda: describe(loop)):
            prepared = self._caretaker.prepared()
            if prepared is not None:
                self.commands.submit("reload", prepared)


def describe(loop: ControllerLoop) -> str:
    """How the controller is, in one line."""
    state = loop.state
    tdc = f"{state.motion.tdc_m * 1e3:.2f}" if state.motion.stroke else "-"
    wanted_mm = state.set_points.tdc_ref_m * 1e3
    return f"{state.mode.name.lower()}, tick {loop.tick}, TDC {tdc} of {wanted_mm:.2f} mm"
