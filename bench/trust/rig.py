"""Both loops in memory, in steps of a tick, where time, link, sensors and actuators can fail.

The loops, the codec and the engine are those of a run in real time; the clock is the rig's.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

import controller.build
import controller.loop
import plant.build
import plant.memory
from controller.mode.start_restart import Mode
from drivers.channels import MemoryCommands, MemoryStatus
from drivers.links import Connection
from hil.config.resolved import Resolved
from hil.log import topics
from hil.log.records import PAYLOAD_OFFSET
from hil.pacing import Pacer, Slot
from hil.ports import Link, Recorder
from hil.wire.codec import Decoder, Encoder
from hil.wire.messages import Message

BURST_NS: Final = 50_000
"""What a turn of the controller takes at the least, when a backlog lets it run at once."""

_head_of: Final = struct.Struct("<BQH").unpack_from

Tamper = Callable[[int, Sequence[Message]], Sequence[Message]]
"""What becomes of the messages of a tick on their way."""


class RigPacer(Pacer):
    """A slot a tick by the rig's clock; the plant skips the slots that have passed."""

    def __init__(self, period_ns: int, patience_ns: int = 0) -> None:
        super().__init__(period_ns, patience_ns)
        self.t_ns = 0

    def start(self, tick: int = 0) -> None:
        """Nothing to start: time is the rig's."""

    def wait(self, tick: int) -> Slot:
        """Return the slot of the tick, or the one that is due by now."""
        due = max(tick, self.t_ns // self.period_ns)
        return Slot(due, due * self.period_ns, self.t_ns, due - tick)

    def now_ns(self) -> int:
        """Return the time [ns]."""
        return self.t_ns


class RigLink(Link):
    """One end: what it sends the other receives, unless it is silenced or tampered with."""

    def __init__(self, sender: str) -> None:
        self.inbox: deque[bytes] = deque()
        self.peer = self
        self.tick = 0
        self.silent = False
        self.tamper: Tamper | None = None
        self._decoder = Decoder(sender)
        self._encoder = Encoder()

    def send(self, batch: bytes, /) -> None:
        """Put a batch into the peer's hands."""
        if self.tamper is not None:
            messages = self.tamper(self.tick, self._decoder.decode(batch))
            batch = self._encoder.encode(messages)
        if not self.silent:
            self.peer.inbox.append(batch)

    def resume(self, counters: tuple[int, ...]) -> None:
        """Go on with the sender's own counters, so that tampering alone breaks none."""
        self._decoder.forget_counters()
        self._encoder.recall(counters)

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None."""
        return self.inbox.popleft() if self.inbox else None

    def wait(self, _timeout_ns: int, /) -> bytes | None:
        """Like `receive`."""
        return self.receive()

    def peer_alive(self) -> bool:
        """Both ends are there."""
        return True

    def wait_for_peer(self, _timeout_s: float) -> None:
        """Both ends are there."""

    def counters(self) -> Mapping[str, int]:
        """Return nothing: the rig counts."""
        return {}

    def close(self) -> None:
        """Nothing to give back."""


class Told(NamedTuple):
    """An event that one side has logged, by the rig's tick."""

    tick: int
    side: str
    code: str
    text: str


class EventTally(Recorder):
    """A recorder that keeps the events alone."""

    def __init__(self, side: str) -> None:
        self.side = side
        self.tick = 0
        self.told: list[Told] = []

    def put(self, data: bytes, /) -> None:
        """Look through the records of one tick."""
        at = 0
        while at < len(data):
            _, length, channel = _head_of(data, at)
            end = at + 9 + length
            if channel == topics.EVENT.channel_id:
                values = topics.EVENT.layout.unpack(data[at + PAYLOAD_OFFSET : end])
                self.told.append(Told(self.tick, self.side, str(values[3]), str(values[4])))
            at = end


class RigMemory(NamedTuple):
    """All that the next turn depends on: a fault begins from here as often as one likes."""

    tick: int
    plant: plant.memory.LoopMemory
    controller: controller.loop.LoopMemory
    inboxes: tuple[tuple[bytes, ...], tuple[bytes, ...]]


class Rig:
    """Plant and controller; `turn` runs one tick of the clock.

    plant_frozen, controller_frozen: that process gets no time; what is sent to it waits
    """

    def __init__(self, scenario: Resolved) -> None:
        self.scenario = scenario
        period_ns = self.period_ns = scenario.loop.period_ns
        self.tick = 0
        self.plant_frozen = self.controller_frozen = False
        self.plant_link, self.controller_link = RigLink("plant"), RigLink("controller")
        self.plant_link.peer, self.controller_link.peer = self.controller_link, self.plant_link
        self.commands, self.plant_commands = MemoryCommands(), MemoryCommands()
        self._tallies = EventTally("plant"), EventTally("controller")
        self._burst = max(period_ns // BURST_NS, 1)
        self._pacers = RigPacer(period_ns), RigPacer(period_ns, period_ns * 3 // 2)
        self.plant = plant.build.make_loop(
            scenario, _connection(self.plant_link, self.plant_commands), self._tallies[0],
            self._pacers[0],
        )  # fmt: skip
        self.controller = controller.build.make_loop(
            scenario, _connection(self.controller_link, self.commands), self._tallies[1],
            self._pacers[1],
        )  # fmt: skip

    @property
    def told(self) -> list[Told]:
        """The events of both sides, in order."""
        return sorted((told for tally in self._tallies for told in tally.told), key=_by_tick)

    @property
    def contacts(self) -> int:
        """How often the piston has struck a head."""
        return self.plant.state.contacts

    @property
    def is_controller_safe(self) -> bool:
        """Whether the controller is in its safe state."""
        return self.controller.state.mode is Mode.SAFE

    def turn(self) -> None:
        """Run one tick: the plant's turn at its start, the controller's within it."""
        tick = self.tick
        for pacer in self._pacers:
            pacer.t_ns = tick * self.period_ns
        self.plant_link.tick = self.controller_link.tick = tick
        for tally in self._tallies:
            tally.tick = tick
        if not self.plant_frozen:
            self.plant.turn(self.plant.state.tick)
        self._pacers[1].t_ns += self.period_ns // 2
        if not self.controller_frozen:
            self._answer()
        self.tick += 1

    def remember(self) -> RigMemory:
        """Return where the rig stands."""
        inboxes = tuple(self.plant_link.inbox), tuple(self.controller_link.inbox)
        return RigMemory(self.tick, self.plant.remember(), self.controller.remember(), inboxes)

    def recall(self, memory: RigMemory) -> None:
        """Go on from what `remember` returned, with nothing wrong and nothing told."""
        self.tick, self.plant_frozen, self.controller_frozen = memory.tick, False, False
        self.plant.recall(memory.plant)
        self.controller.recall(memory.controller)
        for link, waiting in zip((self.plant_link, self.controller_link), memory.inboxes,
                                 strict=True):  # fmt: skip
            link.inbox.clear()
            link.inbox.extend(waiting)
            link.silent, link.tamper = False, None
        self.plant_link.resume(memory.plant.sent)
        self.controller_link.resume(memory.controller.sent)
        for tally in self._tallies:
            tally.told.clear()

    def _answer(self) -> None:
        """Let the controller take what has come, or step without."""
        link, loop = self.controller_link, self.controller
        if not link.inbox:
            if loop.tick >= 0:
                loop.turn(None)
            return
        for _ in range(min(len(link.inbox), self._burst)):
            loop.turn(link.receive())


def _connection(link: RigLink, commands: MemoryCommands) -> Connection:
    return Connection(link, commands, MemoryStatus(), link.close)


def _by_tick(told: Told) -> int:
    return told.tick
