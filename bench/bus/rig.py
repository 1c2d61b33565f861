"""Both loops on a CAN bus of their own making, where every frame can be hurt: no time passes.

The loops, the link with its assembly, the codec and the engine are those of a run in real time;
only clock and wire are the rig's. A frame arrives 50 us after it was sent.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple, Protocol

import controller.build
import plant.build
from controller.mode.start_restart import Mode
from drivers.can.link import CanLink, Times
from drivers.channels import MemoryCommands, MemoryStatus
from drivers.links import Connection
from drivers.recorder.client import NullRecorder
from drivers.zenoh.config import Role
from hil.config.resolved import Resolved
from hil.pacing import Pacer, Slot
from hil.ports import Recorder
from hil.wire.codec import iter_frames

TRANSIT_NS: Final = 50_000
ANSWER_AFTER_NS: Final = 500_000
"""The controller's turn within a tick, late enough for a tick that lacks frames to be over."""


class Sent(NamedTuple):
    """A frame on its way: who sent it, in which tick, and which frame of its identifier it is."""

    sender: Role
    tick: int
    can_id: int
    word: int
    number: int


class Fault(Protocol):
    """What a bus does to the frames of one tick."""

    def apply(self, frames: list[Sent], tick: int) -> Iterable[tuple[Sent, int]]:
        """Return the frames that arrive, each with a delay [ns]."""


class Clock:
    """The rig's time."""

    def __init__(self) -> None:
        self.t_ns = 0

    def now_ns(self) -> int:
        """Return the time [ns]."""
        return self.t_ns


class RigPacer(Pacer):
    """A slot a tick, never late, never waiting for an answer."""

    def __init__(self, clock: Clock, period_ns: int) -> None:
        super().__init__(period_ns)
        self._clock = clock

    def now_ns(self) -> int:
        """Return the rig's time [ns]."""
        return self._clock.t_ns

    def wait(self, tick: int) -> Slot:
        """Return the slot of the tick."""
        return Slot(tick, tick * self.period_ns, tick * self.period_ns, 0)


class RigPort:
    """One node of the rig's bus."""

    stamps = True

    def __init__(self, side: Role, wire: Wire) -> None:
        self.name = f"rig:{side}"
        self.side = side
        self._wire = wire
        self._numbers: dict[int, itertools.count[int]] = {}
        self.inbox: list[tuple[int, int, int]] = []
        self.peer = self

    def send(self, batch: bytes, _deadline_ns: int, /) -> None:
        """Put a batch on the wire."""
        frames = []
        for can_id, word in iter_frames(batch):
            numbers = self._numbers.setdefault(can_id, itertools.count())
            frames.append(Sent(self.side, self._wire.tick, can_id, word, next(numbers)))
        self._wire.carry(frames, self.peer.inbox)

    def ask(self, can_id: int, /) -> None:
        """Nobody to ask: both ends are there."""

    def receive(self) -> list[tuple[int, int, int]]:
        """Return the frames that have arrived."""
        now_ns = self._wire.clock.t_ns
        self.inbox.sort(key=lambda frame: frame[2])
        due = sum(1 for frame in self.inbox if frame[2] <= now_ns)
        arrived, self.inbox[:] = self.inbox[:due], self.inbox[due:]
        return arrived

    def settle(self) -> None:
        """Both ends are there."""

    def notices(self) -> list[tuple[str, str]]:
        """Return nothing: the rig's bus reports no errors."""
        return []

    def counters(self) -> Mapping[str, int]:
        """Return nothing: the wire counts."""
        return {}

    def close(self) -> None:
        """Nothing to give back."""


class Wire:
    """The wire between both nodes, with what goes wrong on it."""

    def __init__(self, clock: Clock, fault: Fault) -> None:
        self.clock = clock
        self.tick = 0
        self.delivered = 0
        self._fault = fault
        self._arrivals: dict[int, list[tuple[int, int]]] = {}

    def carry(self, frames: list[Sent], inbox: list[tuple[int, int, int]]) -> None:
        """Let the frames of one tick arrive as the fault lets them."""
        for frame, delay_ns in self._fault.apply(frames, self.tick):
            at_ns = self.clock.t_ns + TRANSIT_NS + delay_ns
            inbox.append((frame.can_id, frame.word, at_ns))
            self._arrivals.setdefault(frame.can_id, []).append((at_ns, frame.number))
            self.delivered += 1

    def missing(self) -> int:
        """Return how many frames never came though a later one of their kind did."""
        total = 0
        for arrivals in self._arrivals.values():
            came = {number for _, number in arrivals}
            total += max(came) + 1 - len(came)
        return total

    def overtaken(self) -> int:
        """Return how many frames came after a later one of their kind."""
        total = 0
        for arrivals in self._arrivals.values():
            newest = -1
            for _, number in sorted(arrivals, key=lambda arrival: arrival[0]):
                total += number < newest
                newest = max(newest, number)
        return total


class RigPresence:
    """A process that knows that both are there."""

    lockstep = False

    def __init__(self, role: Role) -> None:
        self.role = role

    def alive(self) -> set[str]:
        """Return both roles."""
        return {"plant", "controller"}

    def is_met(self) -> bool:
        """They fit: this process has made both."""
        return True

    def ready(self) -> None:
        """Both take turns: nobody begins before the other."""

    def note(self, _code: str, _text: str) -> None:
        """Nothing happens around a session that is none."""

    def notices(self) -> list[tuple[str, str]]:
        """Return nothing, for the same reason."""
        return []


class Tally(Recorder):
    """A recorder that only counts the plant's misfires."""

    def __init__(self) -> None:
        self.misfires = 0

    def put(self, data: bytes, /) -> None:
        """Look through the records of one tick."""
        if b"misfire\0" in data:
            self.misfires += 1


class Rig:
    """Plant and controller loop on one wire; `turn` runs a tick of both."""

    def __init__(self, scenario: Resolved, fault: Fault) -> None:
        self.scenario = scenario
        self.period_ns = scenario.loop.period_ns
        self.clock = Clock()
        self.wire = Wire(self.clock, fault)
        ports: dict[Role, RigPort] = {
            "plant": RigPort("plant", self.wire), "controller": RigPort("controller", self.wire),
        }  # fmt: skip
        ports["plant"].peer, ports["controller"].peer = ports["controller"], ports["plant"]
        self.links = {side: self._link(port) for side, port in ports.items()}
        pacer = RigPacer(self.clock, self.period_ns)
        self.tally = Tally()
        self.plant = plant.build.make_loop(
            scenario, _connection(self.links["plant"]), self.tally, pacer
        )
        self.controller = controller.build.make_loop(
            scenario, _connection(self.links["controller"]), NullRecorder(), pacer
        )
        self.without_sample: list[int] = []
        self.without_answer: list[int] = []

    def _link(self, port: RigPort) -> CanLink:
        times = Times(self.clock.now_ns, self.clock.now_ns)
        return CanLink(port, RigPresence(port.side), self.period_ns, times)

    @property
    def is_safe(self) -> bool:
        """Whether the controller is in its safe state."""
        return self.controller.state.mode is Mode.SAFE

    @property
    def plant_is_safe(self) -> bool:
        """Whether the plant has given its controller up."""
        return self.plant.state.latch != 0

    def turn(self, tick: int) -> None:
        """Run one tick: the plant's turn at its start, the controller's within it."""
        self.wire.tick = tick
        self.clock.t_ns = tick * self.period_ns
        answered = self.plant.answered
        self.plant.turn(tick)
        if self.plant.answered == answered:
            self.without_answer.append(tick)
        self.clock.t_ns += ANSWER_AFTER_NS
        self._answer()

    def _answer(self) -> None:
        """Let the controller take what has come, or step without."""
        loop, link = self.controller, self.links["controller"]
        batches = []
        while (batch := link.receive()) is not None:
            batches.append(batch)
        if not batches:
            rest = link.rest()
            if loop.tick < 0:
                return
            self._step(rest)
        for batch in batches:
            self._step(batch)

    def _step(self, batch: bytes | None) -> None:
        before = self.controller.tick
        self.controller.turn(batch)
        after, stale = self.controller.tick, self.controller.state.stale
        self.without_sample += range(max(after - stale, before) + 1, after + 1)


def _connection(link: CanLink) -> Connection:
    return Connection(link, MemoryCommands(), MemoryStatus(), link.close)
