"""The plant's turn: send the sample, take the answer to the one before, step, record, tell.

Everything that touches the outside goes through a port; the physics is in plant/rig/step.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mypy_extensions import i64

from hil import snapshot
from hil.errors import ConfigError
from hil.exchange import await_batch
from hil.log import topics
from hil.names.changes import Changes
from hil.pacing import Pacer, Slot
from hil.ports import CommandSource, Link, Recorder, StatusSink
from hil.stimuli.player import Player
from hil.values import NEVER
from hil.wire.changes import is_one as is_request
from hil.wire.codec import Decoder, Encoder
from plant import faults
from plant.answers import Answer, Answers
from plant.log import pack_events, pack_skipped, pack_turn, pack_valves, pack_winding, status_of
from plant.memory import LoopMemory, Measured, Ordered
from plant.rig.events import Event
from plant.rig.params import PlantParams
from plant.rig.state import AS_BEFORE, PlantState
from plant.rig.step import step
from plant.sample_frames import sample_messages
from plant.sensors import sample, sensed
from plant.stimulation import Stimulation
from plant.tuning import changed, enforced

_COMMAND_EVERY: Final = 10
_MOST_ARRIVED: Final = 256
_NO_EVENTS: Final[tuple[Event, ...]] = ()


class PlantLoop:
    """One engine on one link; `turn` runs one tick."""

    def __init__(
        self,
        params: PlantParams,
        state: PlantState,
        events: tuple[Event, ...] = _NO_EVENTS,
        *,
        link: Link,
        pacer: Pacer,
        recorder: Recorder,
        status: StatusSink,
        status_every: int,
        snapshot_every: int = 0,
        commands: CommandSource | None = None,
        player: Player | None = None,
    ) -> None:
        self.params = params
        self.state = state
        self.missed = 0
        self.answers = Answers(link, state.tick, params.period_ns, params.stale_ticks)
        self._late_max_ns = 0
        self._link = link
        self._pacer = pacer
        self._put = recorder.put
        self._status = status
        self._status_every = status_every
        self._encoder = Encoder()
        self._initial_events = events
        self._snapshot_every = snapshot_every or NEVER
        self._commands = commands
        self._heard = b""
        self._ordered_faults: tuple[Ordered, ...] = ()
        self._changes = Changes("plant", changed)
        self._change_tick: i64 = NEVER
        self._stimulation = Stimulation(player)
        self.params, self.state = self._stimulation.apply(params, state, _NO_EVENTS)
        self._measured = self._measure()

    @property
    def answered(self) -> int:
        """How many ticks were answered."""
        return self.answers.answered

    @property
    def decoder(self) -> Decoder:
        """What decodes the controller's frames, and counts them."""
        return self.answers.decoder

    def turn(self, tick: int) -> int:
        """Run the tick, or the one that is due by now; return the tick after it."""
        slot = self._pacer.wait(tick)
        if slot.tick > tick:
            self._catch_up(tick, slot)
        measured, told = self._measured, self._stimulation.told
        sent_ns, arrived = self._send_and_take(slot.tick, measured.batch)
        answer = self._understand(arrived)
        if self._commands is not None and slot.tick % _COMMAND_EVERY == 0:
            self._take_fault(self._commands, slot.tick)
        changed_to = self._change(slot.tick)
        before = self.state
        self.state, events = step(self.params, before, answer.command)
        self._stimulate(events)
        self._measured = self._measure()
        self._record(slot, sent_ns, measured, answer, before, changed_to + events, told)
        self._tell(slot)
        if self._changes.requests or self._change_tick == slot.tick + 1:
            self._heard += self._changes.attend(slot.tick, self.params, self._commands)
            self._change_tick = self._changes.next_tick
        return slot.tick + 1

    def _stimulate(self, events: tuple[Event, ...]) -> None:
        """Let the scenario's stimuli change parameters at the start of the tick that comes next."""
        stimulation = self._stimulation
        stimulation.ordered = self._ordered_faults
        self.params, self.state = stimulation.apply(self.params, self.state, events)
        self._ordered_faults = stimulation.ordered

    def _change(self, tick: int) -> tuple[Event, ...]:
        """Put the parameters in force that act from this tick on; returns what came of it."""
        if tick < self._change_tick:
            return _NO_EVENTS
        self.params, change = self._changes.take(tick, self.params)
        self._change_tick = self._changes.next_tick
        self.answers.stale_ticks = self.params.stale_ticks
        events = [Event(tick * self.params.period_ns, code, text) for code, text in change.events]
        if change.keys:
            self.state = enforced(self.params, self.state, events)
        return tuple(events)

    def plan(self, tick: int, values: Mapping[str, object], origin: str) -> None:
        """Change parameters from a tick on."""
        self._change_tick = self._changes.plan(tick, values, origin)

    def _send_and_take(self, tick: int, batch: bytes) -> tuple[int, list[bytes]]:
        """Send the sample of this tick, and take what acts in it.

        Real time: what has come before the send, so that no answer acts too early. Lockstep: the
        answer to the tick before, for which the sample of this one need not wait.
        """
        patience_ns = 0 if self.answers.peer_lost else self._pacer.patience_ns
        arrived = [] if patience_ns else self._drain()
        self._link.send(batch)
        sent_ns = self._pacer.now_ns()
        if patience_ns and tick > self.answers.first_tick:
            arrived = self._await(patience_ns)
        return sent_ns, arrived

    def _drain(self) -> list[bytes]:
        """What has come; of a flood a part, so that the tick is not late for it."""
        arrived: list[bytes] = []
        while len(arrived) < _MOST_ARRIVED and (batch := self._link.receive()) is not None:
            arrived.append(batch)
        return arrived

    def _await(self, patience_ns: int) -> list[bytes]:
        """The answer must come, or the peer is lost."""
        batch = await_batch(self._link, patience_ns)
        if batch is None:
            self.answers.peer_lost = True
            return []
        return [batch]

    def _understand(self, arrived: list[bytes]) -> Answer:
        return self.answers.understand(arrived, self.state.tick)

    def _measure(self) -> Measured:
        """Sense the state at the start of the next tick and encode it, ahead of its slot."""
        params, state = self.params, self.state
        seen, slowly = sample(params, state), sensed(params, state)
        batch = self._encoder.encode(sample_messages(params, state, seen, slowly))
        return Measured(
            seen.x_m, seen.v_m_s, slowly.p_left_pa, slowly.p_right_pa, slowly.electric_power_w,
            batch,
        )  # fmt: skip

    def _take_fault(self, commands: CommandSource, tick: int) -> None:
        """Take a fault that was ordered over the command key; what is not ours is left alone."""
        received = commands.poll()
        if received is None:
            return
        origin, raw = received
        t_ns = tick * self.params.period_ns
        heard = topics.COMMAND.pack(tick, t_ns, origin, raw)
        if is_request(raw):
            self._changes.requests.append((origin, raw))
            self._heard += heard
            return
        try:
            event = faults.parse(raw, origin, t_ns, self.params.config)
        except ConfigError as error:
            heard += topics.EVENT.pack(tick, t_ns, topics.WARNING, "command-refused", str(error))
            commands.answer(False, tick, str(error))
            event = None
        if event is not None:
            ordered = Ordered(raw.decode(), t_ns, self.state.disturbances.next_edge)
            self._ordered_faults += (ordered,)
            self.params = faults.with_fault(self.params, ordered.next_edge, event)
            text = f"{event.kind} from {origin}"
            heard += topics.EVENT.pack(tick, t_ns, topics.INFO, "command", text)
            commands.answer(True, tick, text)
        self._heard = heard

    def _catch_up(self, tick: int, slot: Slot) -> None:
        """Integrate the ticks whose slots have passed: nothing was sent, and nothing answered.

        Once the controller has been heard, that is silence.
        """
        held = None if self.answers.answered else AS_BEFORE
        self.missed += slot.tick - tick
        for missed in range(tick, slot.tick):
            changed_to = self._change(missed)
            before, told = self.state, self._stimulation.told
            self.state, events = step(self.params, before, held)
            self._stimulate(events)
            t_ns, events = missed * self.params.period_ns, changed_to + events
            data = pack_skipped(missed, t_ns, slot.woke_ns, before)
            self._put(data + pack_events(missed, t_ns, events) + told)
        self._measured = self._measure()

    def _record(
        self, slot: Slot, sent_ns: int, measured: Measured, answer: Answer, before: PlantState,
        events: tuple[Event, ...], told: bytes,
    ) -> None:  # fmt: skip
        """Hand the whole tick to the recorder, after everything that is in a hurry."""
        tick, period_ns = slot.tick, self.params.period_ns
        t_ns = tick * period_ns
        data = pack_turn(slot, t_ns, sent_ns, measured, answer, before) + told
        if self._initial_events:
            self._initial_events, events = _NO_EVENTS, self._initial_events + events
        if events:
            data += pack_events(tick, t_ns, events)
        if self.state.pulses.valves.told:
            data += pack_valves(self.params, tick, before, self.state)
        if self.params.instrumented:
            data += pack_winding(self.params, tick, before)
        if self._heard:
            data, self._heard = data + self._heard, b""
        if (tick + 1) % self._snapshot_every == 0:
            text = snapshot.dumps(self.remember())
            data += topics.SNAPSHOT.pack(tick + 1, t_ns + period_ns, text)
        self._put(data)

    def remember(self) -> LoopMemory:
        """Return all that the next turn depends on besides its inputs."""
        sent, answers = self._encoder.remember(), self.answers.remember()
        return LoopMemory(
            self.state, sent, answers, self._measured, self._ordered_faults,
            self._changes.remember(), self._stimulation.remember(), self._stimulation.told,
        )  # fmt: skip

    def recall(self, memory: LoopMemory) -> None:
        """Go on from what `remember` returned."""
        self.state, self._measured = memory.state, memory.measured
        self._encoder.recall(memory.sent)
        self.answers.recall(memory.answers)
        self._ordered_faults = memory.ordered
        self.params = self._changes.recall(memory.changes, self.params)
        self.params = faults.with_ordered(self.params, memory.ordered)
        self.params = self._stimulation.recall(memory.stimuli, self.params)
        self._stimulation.told = memory.told
        self._change_tick = self._changes.next_tick
        self.answers.stale_ticks = self.params.stale_ticks
        self._initial_events = _NO_EVENTS

    def _tell(self, slot: Slot) -> None:
        """Publish now and then how the plant is."""
        late_ns = slot.woke_ns - slot.scheduled_ns
        self._late_max_ns = max(self._late_max_ns, late_ns)
        if slot.tick % self._status_every:
            return
        told = status_of(slot, self._late_max_ns, self.state, self.answers)
        self._status.publish(told | {"missed": self.missed, "changes": self._changes.count})
        self._late_max_ns = 0
