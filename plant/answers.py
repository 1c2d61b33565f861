"""What the controller answers: batches to commands in the plant's terms, and when none come."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.ports import Link
from hil.values import Value
from hil.wire import pulses as wire
from hil.wire.codec import Decoder, DecoderMemory
from hil.wire.e2e import MAX_DELTA
from hil.wire.messages import ControllerTick, MachineCommand, Message, Pulse
from plant.engines.machine import MachineOrder
from plant.rig.state import AS_BEFORE, Command

_TICK_MASK: Final = 0xFFFFFFFF
_COMING_UP_NS: Final = 1_000_000_000
"""For so long at the most the plant goes on as it began when nothing is heard."""


@final
class Answer(Value):
    """What the controller's frames said: to which tick, and the batches they came in."""

    __slots__ = ("tick", "command", "batches", "throttle")

    def __init__(
        self, tick: int, command: Command | None, batches: tuple[bytes, ...], throttle: float = 1.0
    ) -> None:
        self.tick = tick
        self.command = command
        self.batches = batches
        self.throttle = throttle


_NO_BATCHES: Final[tuple[bytes, ...]] = ()
_NO_ANSWER: Final = Answer(-1, None, _NO_BATCHES)
_NOT_YET: Final = Answer(-2, AS_BEFORE, _NO_BATCHES)
"""Before the first answer nothing is missing: the plant goes on as it began."""


@final
class AnswersMemory(Value):
    """All that the next answer's meaning depends on besides its bytes."""

    __slots__ = (
        "received", "first_tick", "used_tick", "answered", "answered_before", "peer_lost",
        "silent_turns", "throttle",
    )  # fmt: skip

    def __init__(
        self,
        received: DecoderMemory,
        first_tick: int,
        used_tick: int,
        answered: int,
        answered_before: bool,
        peer_lost: bool,
        silent_turns: int,
        throttle: float,
    ) -> None:
        self.received = received
        self.first_tick = first_tick
        self.used_tick = used_tick
        self.answered = answered
        self.answered_before = answered_before
        self.peer_lost = peer_lost
        self.silent_turns = silent_turns
        self.throttle = throttle


class Answers:
    """The controller's end as the plant hears it."""

    def __init__(self, link: Link, first_tick: int, period_ns: int, stale_ticks: int) -> None:
        self.decoder = Decoder("controller")
        self.first_tick = first_tick
        self.used_tick = -1
        self.answered = 0
        self.stale = 0  # answers that had waited too long to be acted on
        self.peer_lost = False
        self._link = link
        self._period_ns = period_ns
        self.stale_ticks = stale_ticks
        self._answered_before = False
        self._silent_turns = 0
        self._throttle = 1.0
        # Commands repeat for many ticks: what they come to is worked out when they change.
        self._mode = -1
        self._machine: MachineCommand | None = None
        self._pulses: list[Pulse] = []
        self._command = AS_BEFORE

    def understand(self, arrived: list[bytes], tick: int) -> Answer:
        """Decode the answers that act from now on; of several the newest machine order counts."""
        if not arrived:
            return self._unanswered(tick)
        self._silent_turns = 0
        head, machine, pulses = self._fresh(arrived[0], tick)
        if len(arrived) > 1:
            head, machine, pulses = self._read_on(arrived, tick, head, machine, pulses)
        if head is None:
            return Answer(-1, None, tuple(arrived))
        self.peer_lost = False
        self._answered_before = True
        self.answered += 1
        self.used_tick = head.tick
        if not self._is_repeated(head.mode, machine, pulses):
            self._mode, self._machine, self._pulses = head.mode, machine, pulses
            self._command = _commanded(machine, pulses, head.mode)
            if machine is not None:
                self._throttle = machine.throttle
        return Answer(head.tick, self._command, tuple(arrived), self._throttle)

    def _read_on(
        self, arrived: list[bytes], tick: i64, head: ControllerTick | None,
        machine: MachineCommand | None, pulses: list[Pulse],
    ) -> tuple[ControllerTick | None, MachineCommand | None, list[Pulse]]:  # fmt: skip
        """Decode the answers after the first, of which the newer counts."""
        for batch in arrived[1:]:
            next_head, next_machine, newer = self._fresh(batch, tick)
            head = head if next_head is None else next_head
            machine = machine if next_machine is None else next_machine
            pulses = wire.superseded(pulses, newer)
        return head, machine, pulses

    def _fresh(
        self, batch: bytes, tick: i64
    ) -> tuple[ControllerTick | None, MachineCommand | None, list[Pulse]]:
        """What one batch holds; nothing when it answers a sample that is too old by now."""
        head, machine, pulses = _read(self.decoder.decode(batch))
        age = 0 if head is None else tick - head.tick & _TICK_MASK
        if age <= self.stale_ticks or age > _TICK_MASK >> 1:
            return head, machine, pulses
        self.stale += 1
        return None, None, []

    def _is_repeated(self, mode: int, machine: MachineCommand | None, pulses: list[Pulse]) -> bool:
        """Whether an answer says what the last one did; a repeated frame is the same message."""
        if mode != self._mode or machine is not self._machine or len(pulses) != len(self._pulses):
            return False
        for index, pulse in enumerate(pulses):
            said = self._pulses[index]
            if pulse is not said and not _is_same(pulse, said):
                return False
        return True

    def _unanswered(self, tick: int) -> Answer:
        """Nothing came: not yet, while the controller is coming up, or no more."""
        self._silent_turns += 1
        if self._silent_turns == MAX_DELTA:
            self.decoder.forget_counters()
        if self._answered_before or self.peer_lost or not self._link.peer_alive():
            return _NO_ANSWER
        waited_ns = (tick - self.first_tick) * self._period_ns
        return _NOT_YET if waited_ns < _COMING_UP_NS else _NO_ANSWER

    def remember(self) -> AnswersMemory:
        """Return all that the next answer's meaning depends on."""
        return AnswersMemory(
            self.decoder.remember(), self.first_tick, self.used_tick, self.answered,
            self._answered_before, self.peer_lost, self._silent_turns, self._throttle,
        )  # fmt: skip

    def recall(self, memory: AnswersMemory) -> None:
        """Go on from what `remember` returned."""
        self.decoder.recall(memory.received)
        self.first_tick, self.used_tick = memory.first_tick, memory.used_tick
        self.answered, self._answered_before = memory.answered, memory.answered_before
        self.peer_lost, self._silent_turns = memory.peer_lost, memory.silent_turns
        self._throttle = memory.throttle


def _is_same(one: Pulse, other: Pulse) -> bool:
    """Whether two frames order the same pulse: two that take turns are decoded every time."""
    return (
        one.channel == other.channel
        and one.open_us == other.open_us
        and one.duration_us == other.duration_us
    )


def _read(
    messages: list[Message],
) -> tuple[ControllerTick | None, MachineCommand | None, list[Pulse]]:
    """Sort what one batch held; of what came through more than once the last counts."""
    head, machine = None, None
    pulses: list[Pulse] = []
    for message in messages:
        if type(message) is ControllerTick:
            head = message
        elif type(message) is MachineCommand:
            machine = message
        elif type(message) is Pulse:
            pulses.append(message)
    return head, machine, pulses


def _commanded(machine: MachineCommand | None, pulses: list[Pulse], mode: int) -> Command:
    """What the frames of one answer order, in the plant's own terms."""
    order, throttle = None, -1.0
    if machine is not None:
        order = MachineOrder(machine.mode, machine.force_n, machine.load_coefficient_n_s_m)
        throttle = machine.throttle
    return Command(order, wire.orders_of(pulses), wire.may_fire(mode), throttle)
