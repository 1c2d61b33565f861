"""The plant's turn: send the sample, take the answer to the one before, step, record.

Everything that touches the outside goes through a port; the physics is in plant/step.py.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from hil import snapshot, topics
from hil.codec import Decoder, Encoder
from hil.e2e import MAX_DELTA
from hil.errors import ConfigError
from hil.exchange import await_batch
from hil.messages import (
    ELECTRIC_POWER,
    FIRING_MODES,
    P_LEFT,
    P_RIGHT,
    PULSE_CLOCK_US,
    SLOW_ORDER,
    ControllerTick,
    MachineCommand,
    Message,
    PistonSample,
    PlantTick,
    Pulse,
)
from hil.pacing import NEVER, Pacer, Slot
from hil.ports import CommandSource, Link, Recorder, StatusSink
from hil.records import together
from hil.signals import most_of
from plant import events as codes
from plant import faults
from plant.actuation import PulseOrder
from plant.events import Event
from plant.machine import MachineOrder
from plant.memory import LoopMemory, Measured, Ordered
from plant.params import PlantParams
from plant.sensors import electric_power_w, pressures_pa, sample
from plant.state import Command, PlantState, truth
from plant.step import step

_NAN: Final = float("nan")
_NO_PULSES: Final = (0,) * 13  # none of them, then channels, openings and durations
_PADDING: Final = ((0, 0, 0),) * 4
_PACK_TICK: Final = together(topics.SENSOR, topics.TRUTH, topics.TIMING)
_PACK_ANSWERED: Final = together(topics.SENSOR, topics.TRUTH, topics.TIMING, topics.ACTUATOR)
_X_MOST, _V_MOST = most_of(PistonSample, "x_m"), most_of(PistonSample, "v_m_s")
_POWER_MOST = most_of(PlantTick, "electric_power_w")
_P_MOST = most_of(PlantTick, "p_left_pa")
_SEVERITY: Final = {
    codes.CONTACT: topics.FAULT,
    codes.SAFE_STATE: topics.FAULT,
    codes.MISFIRE: topics.WARNING,
    codes.PULSE_REFUSED: topics.WARNING,
    codes.ORDER_REFUSED: topics.WARNING,
}


class Answer(NamedTuple):
    """What the controller's frames said: to which tick, and the batches they came in."""

    tick: int
    command: Command | None
    batches: tuple[bytes, ...]
    throttle: float = 1.0


_NO_ANSWER: Final = Answer(-1, None, ())
_NOT_YET: Final = Answer(-2, Command(), ())
"""Before the first answer nothing is missing: the plant goes on as it began."""

_COMMAND_EVERY: Final = 10

_COMING_UP_NS: Final = 1_000_000_000
"""For so long at the most."""


class PlantLoop:
    """One engine on one link; `turn` runs one tick."""

    def __init__(
        self,
        params: PlantParams,
        state: PlantState,
        events: tuple[Event, ...] = (),
        *,
        link: Link,
        pacer: Pacer,
        recorder: Recorder,
        status: StatusSink,
        status_every: int,
        snapshot_every: int = 0,
        commands: CommandSource | None = None,
    ) -> None:
        self.params = params
        self.state = state
        self.peer_lost = False
        self.answered = 0
        self.missed = 0
        self._late_max_ns = 0
        self._link = link
        self._pacer = pacer
        self._put = recorder.put
        self._status = status
        self._status_every = status_every
        self._encoder = Encoder()
        self.decoder = Decoder("controller")
        self._used_tick = -1
        self._first_tick = state.tick
        self._initial_events = events
        self._answered_before = False
        self._silent_turns = 0
        self._throttle = 1.0
        # Commands repeat for many ticks: what they come to is worked out when they change.
        self._said: tuple[MachineCommand | None, list[Pulse], int] = (None, [], -1)
        self._command = Command()
        self._snapshot_every = snapshot_every or NEVER
        self._commands = commands
        self._heard = b""
        self._ordered_faults: tuple[Ordered, ...] = ()
        self._measured = self._measure()

    def turn(self, tick: int) -> int:
        """Run the tick, or the one that is due by now; return the tick after it."""
        slot = self._pacer.wait(tick)
        if slot.tick > tick:
            self.missed += slot.tick - tick
            for missed in range(tick, slot.tick):
                self._skip(missed, slot)
            self._measured = self._measure()
        measured = self._measured
        patience_ns = 0 if self.peer_lost else self._pacer.patience_ns
        arrived = [] if patience_ns else self._drain()
        self._link.send(measured.batch)
        sent_ns = self._pacer.now_ns()
        if patience_ns and slot.tick > self._first_tick:
            arrived = self._await(patience_ns)
        answer = self._understand(arrived)
        if self._commands is not None and slot.tick % _COMMAND_EVERY == 0:
            self._take_fault(self._commands, slot.tick)
        before = self.state
        self.state, events = step(self.params, before, answer.command)
        self._measured = self._measure()
        if self._initial_events:
            self._initial_events, events = (), self._initial_events + events
        self._record(slot, sent_ns, measured, answer, before, events)
        late_ns = slot.woke_ns - slot.scheduled_ns
        self._late_max_ns = max(self._late_max_ns, late_ns)
        if slot.tick % self._status_every == 0:
            self._tell(slot)
        return slot.tick + 1

    def _measure(self) -> Measured:
        """Sense the state at the start of the next tick and encode it, ahead of its slot."""
        state, params = self.state, self.params
        tick = state.tick
        x_m, v_m_s = sensed = sample(params, state)
        power = electric_power_w(state)
        left, right = pressures_pa(params.engine, state)
        slow = SLOW_ORDER[tick & 3]
        head = PlantTick(
            tick & 0xFFFFFFFF,
            2,
            slow,
            _within(power, _POWER_MOST) if slow == ELECTRIC_POWER else _NAN,
            _within(left, _P_MOST) if slow == P_LEFT else _NAN,
            _within(right, _P_MOST) if slow == P_RIGHT else _NAN,
        )
        if -_X_MOST <= x_m <= _X_MOST and -_V_MOST <= v_m_s <= _V_MOST:
            body = PistonSample(x_m, v_m_s)
        else:
            body = PistonSample(_within(x_m, _X_MOST), _within(v_m_s, _V_MOST))
        return Measured(sensed, left, right, power, self._encoder.encode((head, body)))

    def _take_fault(self, commands: CommandSource, tick: int) -> None:
        """Take a fault that was ordered over the command key; what is not ours is left alone."""
        received = commands.poll()
        if received is None:
            return
        origin, raw = received
        t_ns = tick * self.params.period_ns
        heard = topics.COMMAND.pack(tick, t_ns, origin, raw)
        try:
            event = faults.parse(raw, origin, t_ns)
        except ConfigError as error:
            heard += topics.EVENT.pack(tick, t_ns, topics.WARNING, "command-refused", str(error))
            event = None
        if event is not None:
            ordered = Ordered(raw.decode(), t_ns, self.state.disturbances.next_edge)
            self._ordered_faults += (ordered,)
            self.params = faults.with_fault(self.params, ordered.next_edge, event)
            text = f"{event.kind} from {origin}"
            heard += topics.EVENT.pack(tick, t_ns, topics.INFO, "command", text)
        self._heard = heard

    def _drain(self) -> list[bytes]:
        """Real time: take what has come, before the send, so that no answer acts too early."""
        arrived = []
        while (batch := self._link.receive()) is not None:
            arrived.append(batch)
        return arrived

    def _await(self, patience_ns: int) -> list[bytes]:
        """Lockstep: the answer to the tick before must come, or the peer is lost.

        The sample of this tick is on its way by then: it does not depend on that answer.
        """
        batch = await_batch(self._link, patience_ns)
        if batch is None:
            self.peer_lost = True
            return []
        return [batch]

    def _understand(self, arrived: list[bytes]) -> Answer:
        """Decode the answers that act from now on; of several the newest machine order counts."""
        if not arrived:
            return self._unanswered()
        self._silent_turns = 0
        head, machine, pulses = _read(self.decoder.decode(arrived[0]))
        for batch in arrived[1:]:
            next_head, next_machine, newer = _read(self.decoder.decode(batch))
            head, machine = next_head or head, next_machine or machine
            pulses = _superseded(pulses, newer)
        if head is None:
            return Answer(-1, None, tuple(arrived))
        self.peer_lost = False
        self._answered_before = True
        self.answered += 1
        self._used_tick = head.tick
        said = (machine, pulses, head.mode)
        if said != self._said:
            self._said, self._command = said, _commanded(*said)
            if machine is not None:
                self._throttle = machine.throttle
        return Answer(head.tick, self._command, tuple(arrived), self._throttle)

    def _unanswered(self) -> Answer:
        """Nothing came: not yet, while the controller is coming up, or no more."""
        self._silent_turns += 1
        if self._silent_turns == MAX_DELTA:
            self.decoder.forget_counters()
        if self._answered_before or self.peer_lost or not self._link.peer_alive():
            return _NO_ANSWER
        waited_ns = (self.state.tick - self._first_tick) * self.params.period_ns
        return _NOT_YET if waited_ns < _COMING_UP_NS else _NO_ANSWER

    def _skip(self, tick: int, slot: Slot) -> None:
        """Integrate a tick whose slot has passed: nothing was sent, so nothing was answered."""
        before = self.state
        held = Command() if before.stale == 0 else None
        self.state, events = step(self.params, before, held)
        t_ns = tick * self.params.period_ns
        data = topics.TRUTH.pack(tick, t_ns, *truth(before)) + topics.TIMING.pack(
            tick, t_ns, t_ns, slot.woke_ns, slot.woke_ns, -1, 1
        )
        self._put(data + _packed_events(tick, t_ns, events))

    def _record(
        self,
        slot: Slot,
        sent_ns: int,
        measured: Measured,
        answer: Answer,
        before: PlantState,
        events: tuple[Event, ...],
    ) -> None:
        """Hand the whole tick to the recorder, after everything that is in a hurry."""
        tick = slot.tick
        t_ns = tick * self.params.period_ns
        (x_m, v_m_s), left, right, power, batch = measured
        values = (
            tick, t_ns, x_m, v_m_s, left, right, power, 0, *truth(before),
            slot.scheduled_ns, slot.woke_ns, sent_ns, answer.tick, 0,
        )  # fmt: skip
        if answer.batches and answer.command is not None:
            data = _PACK_ANSWERED(*values, *self._ordered(t_ns, answer, answer.command))
        else:
            data = _PACK_TICK(*values)
        data += topics.FRAMES_SENT.pack(tick, t_ns, batch)
        for received in answer.batches:
            data += topics.FRAMES_RECEIVED.pack(tick, t_ns, received)
        if events:
            data += _packed_events(tick, t_ns, events)
        if self._heard:
            data, self._heard = data + self._heard, b""
        if (tick + 1) % self._snapshot_every == 0:
            text = snapshot.dumps(self.remember())
            data += topics.SNAPSHOT.pack(tick + 1, t_ns + self.params.period_ns, text)
        self._put(data)

    def _ordered(self, t_ns: int, answer: Answer, command: Command) -> tuple[float, ...]:
        """The decoded answer in SI, as it acts from this tick on: the fields of /actuator."""
        order = command.machine or self.state.machine.order
        if not command.pulses:
            return (answer.tick, *order, answer.throttle, *_NO_PULSES)
        rows = [unwrapped(pulse, t_ns) for pulse in command.pulses[: len(_PADDING)]]
        columns = zip(*(*rows, *_PADDING[len(rows) :]), strict=True)
        channels, opens, durations = columns
        return (answer.tick, *order, answer.throttle, len(rows), *channels, *opens, *durations)

    def remember(self) -> LoopMemory:
        """Return all that the next turn depends on besides its inputs."""
        return LoopMemory(
            self.state, self._encoder.remember(), self.decoder.remember(), self._first_tick,
            self._used_tick, self.answered, self._answered_before, self.peer_lost,
            self._silent_turns, self._throttle, self._measured, self._ordered_faults,
        )  # fmt: skip

    def recall(self, memory: LoopMemory) -> None:
        """Go on from what `remember` returned."""
        (
            self.state, sent, received, self._first_tick, self._used_tick, self.answered,
            self._answered_before, self.peer_lost, self._silent_turns, self._throttle,
            self._measured, self._ordered_faults,
        ) = memory  # fmt: skip
        for text, t_ns, next_edge in self._ordered_faults:
            event = faults.parse(text.encode(), "the log", t_ns)
            if event is not None:
                self.params = faults.with_fault(self.params, next_edge, event)
        self._encoder.recall(sent)
        self.decoder.recall(received)
        self._initial_events = ()

    def _tell(self, slot: Slot) -> None:
        """Publish how the plant is."""
        state = self.state
        self._status.publish(
            {
                "tick": slot.tick,
                "t_s": slot.scheduled_ns * 1e-9,
                "tdc_mm": abs(state.dead_centre.x_m) * 1e3,
                "late_us": (slot.woke_ns - slot.scheduled_ns) // 1000,
                "late_max_us": self._late_max_ns // 1000,
                "missed": self.missed,
                "contacts": state.contacts,
                "answered": self.answered,
                "safe": state.stale >= self.params.stale_ticks,
                "used_tick": self._used_tick,
                "reception": self.decoder.counts()._asdict(),
            }
        )
        self._late_max_ns = 0


def _within(value: float, most: float) -> float:
    """A sensor at the end of its range says the end of its range."""
    return -most if value < -most else most if value > most else value


def unwrapped(pulse: PulseOrder, now_ns: int) -> tuple[int, int, int]:
    """(channel, opening, duration) on the run's clock [ns], nearest to now (2^20 us a turn)."""
    now_us = now_ns // 1000
    half = PULSE_CLOCK_US // 2
    ahead_us = (pulse.open_us - now_us + half) % PULSE_CLOCK_US - half
    return pulse.channel, (now_us + ahead_us) * 1000, pulse.duration_us * 1000


def _read(
    messages: list[Message],
) -> tuple[ControllerTick | None, MachineCommand | None, list[Pulse]]:
    """Sort what one batch held; of what came through more than once the last counts."""
    head, machine = None, None
    pulses = []
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
    order = None if machine is None else MachineOrder(*machine[:3])
    orders = tuple([PulseOrder(*pulse) for pulse in pulses])
    return Command(order, orders, mode in FIRING_MODES)


def _superseded(older: list[Pulse], newer: list[Pulse]) -> list[Pulse]:
    """Of two answers in one tick the newer one counts, channel by channel."""
    channels = [pulse.channel for pulse in newer]
    return [pulse for pulse in older if pulse.channel not in channels] + newer if older else newer


def _packed_events(tick: int, t_ns: int, events: tuple[Event, ...]) -> bytes:
    """The events of a tick at their own instants, which lie inside it."""
    return b"".join(
        topics.EVENT.pack(
            tick,
            max(event.t_ns, t_ns),
            _SEVERITY.get(event.code, topics.INFO),
            event.code,
            event.text,
        )
        for event in events
    )
