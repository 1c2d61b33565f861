"""The controller's turn: take the sample, step, send the answer, record, tell.

Driven by the plant's samples; a tick whose sample does not come in time is stepped without one.
Everything that touches the outside goes through a port; the layers are in controller/step.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, final

from mypy_extensions import i64

from controller.actuator import messages
from controller.live.stimulation import Stimulation, StimulationMemory
from controller.live.tuning import changed, followed
from controller.log import is_occasion, packed_note, packed_occasions, packed_tick, status_of
from controller.mode.schedule import Schedule
from controller.observe.age import SampleAge
from controller.reception import Arrival, Reception, ReceptionMemory
from controller.state import Output, Params, State, StrokeReport
from controller.step import step
from controller.supervisory import Events
from hil import snapshot
from hil.errors import ConfigError
from hil.log import topics
from hil.names.changes import REFUSED, Changes, ChangesMemory, packed
from hil.pacing import Pacer
from hil.ports import Ports, Recorder
from hil.values import NEVER, Value
from hil.wire.changes import is_one as is_request
from hil.wire.changes import parameters_of
from hil.wire.codec import Encoder
from hil.wire.commands import OperatorCommand, parse
from hil.wire.messages import Message

_COMING_UP_NS: Final = 1_000_000_000
"""For so long at the most the first sample is later than what the scenario orders meanwhile."""

_COMMAND_EVERY: Final = 10


@final
class LoopMemory(Value):
    """All that the next turn depends on besides its inputs: layers, codec, and what was counted."""

    __slots__ = ("tick", "state", "sent", "received", "late", "age", "changes", "stimuli")

    def __init__(
        self, tick: i64, state: State, sent: tuple[int, ...], received: ReceptionMemory, late: i64,
        age: tuple[int, int], changes: ChangesMemory, stimuli: StimulationMemory | None = None,
    ) -> None:  # fmt: skip
        self.tick = tick
        self.state = state
        self.sent = sent
        self.received = received
        self.late = late
        self.age = age
        self.changes = changes
        self.stimuli = stimuli


class ControllerLoop:
    """One controller on one link; `turn` answers one batch.

    late: samples that came after their tick had been answered without them, or had waited too long
    heard_tick: that of the newest sample, acted on or not
    oldest_ns: age from which a sample is not acted on; NEVER where time does not pass by itself
    """

    def __init__(
        self, params: Params, state: State, *, ports: Ports, pacer: Pacer, recorder: Recorder,
        schedule: dict[int, OperatorCommand], status_every: int, peer_timeout_s: float,
        snapshot_every: int = 0, oldest_ns: int = NEVER, stimulation: Stimulation | None = None,
    ) -> None:  # fmt: skip
        self.params = params
        self.state = state
        self.tick: i64 = -1
        self.late: i64 = 0
        self.heard_tick: i64 = -1
        self.peer_timeout_s = peer_timeout_s
        self.reception = Reception(params.period_ns, params.possible, all(params.timings.fires))
        self._age = SampleAge(params.period_ns, oldest_ns)
        self._encoder = Encoder()
        self._answer: tuple[Message, ...] = ()
        self._link, self._status, self._commands = ports.link, ports.status, ports.commands
        self._pacer = pacer
        self._recorder = recorder
        self._schedule = Schedule(schedule)
        self._status_every: i64 = status_every
        self._snapshot_every: i64 = snapshot_every or NEVER
        self._stimulation = stimulation
        self._heard = b""  # records of what was heard on the command key
        self._changes = Changes("controller", changed)
        self._change_tick: i64 = NEVER
        self._is_asked = False  # whether somebody waits for what becomes of a command
        self._finished: StrokeReport | None = None  # the last stroke that could fire

    def turn(self, batch: bytes | None) -> None:
        """Answer a batch, or the tick that is due when none came in time."""
        woke_ns = self._pacer.now_ns()
        arrival = self._take(batch, woke_ns)
        if arrival is None:
            return
        for missed in range(self.tick + 1, arrival.tick):
            self._pass(Arrival(missed, b""), woke_ns)
        asked, output = self.state.fuelling.demand, self._step(arrival)
        frames = self._send(output)
        self._record(arrival, output, frames, woke_ns, asked is not self.state.fuelling.demand)
        self._tell(output)
        if self._changes.requests or self._change_tick == self.tick + 1:
            self._heard += self._changes.attend(self.tick, self.params, self._commands)
            self._change_tick = self._changes.next_tick

    def _take(self, batch: bytes | None, woke_ns: i64) -> Arrival | None:
        """What came, under the tick that is to be stepped; None when it is only to be logged."""
        arrival = self.reception.take(batch, self.tick, self.state)
        if arrival.tick >= 0:
            self.heard_tick = arrival.tick
        if self.tick < 0 and batch is not None:
            if arrival.tick < 0:
                self._note("sample-refused", "first frames without a valid head", batch, woke_ns)
                return None
            self._pacer.start(arrival.tick)
            self.tick = arrival.tick - 1
            waited_ticks = _COMING_UP_NS // self.params.period_ns
            self._schedule.pass_over(arrival.tick - waited_ticks)  # a predecessor has done it
        if arrival.tick < 0:
            return Arrival(self.tick + 1, arrival.batch)
        if arrival.tick > self.tick:
            if not self._age.is_too_old(arrival.tick, woke_ns):
                return arrival
            waited_ms = float(self._age.age_ns(arrival.tick, woke_ns)) * 1e-6
            text = f"sample of tick {arrival.tick} has waited for {waited_ms:.1f} ms"
        else:
            text = f"sample of tick {arrival.tick} came after tick {self.tick} was answered"
            text = f"{text} without it"
        self.late += 1
        self._note("sample-late", text, arrival.batch, woke_ns)
        return None

    def _pass(self, arrival: Arrival, woke_ns: int) -> None:
        """Step a tick whose time is over: without an answer, marked as missed."""
        asked, output = self.state.fuelling.demand, self._step(arrival)
        self._record(arrival, output, b"", woke_ns, asked is not self.state.fuelling.demand)
        self._tell(output)

    def _step(self, arrival: Arrival) -> Output:
        """Step one tick."""
        self.tick = arrival.tick
        if arrival.tick >= self._change_tick:
            self._change(arrival.tick)
        command = self._command(arrival.tick)
        if self._stimulation is not None:
            command = self._stimulated(self._stimulation, command)
        if self.reception.doubted:
            why, self.reception.doubted = (("sample-doubted", self.reception.doubted),), ""
            self._heard += packed(self.tick, self.params.period_ns, why)
        self.state, output = step(self.params, self.state, arrival.inputs(command))
        if self._stimulation is not None:
            self._stimulation.note(self.tick, output)
        if self._is_asked:
            self._tell_asker(output.events)
        if command is not None and REFUSED not in dict(output.events):
            self.plan(self.tick + 1, parameters_of(command), "")
        return output

    def _stimulated(
        self, stimulation: Stimulation, command: OperatorCommand | None
    ) -> OperatorCommand | None:
        """Let the scenario's stimuli change what this tick is stepped with; return its command."""
        values = stimulation.take(self.tick, self.tick * self.params.period_ns, self.state)
        self._heard += stimulation.told
        if values:
            self._adopt(changed(self.params, values))
            self.state, told = followed(self.params, self.state, values)
            self._heard += packed(self.tick, self.params.period_ns, told)
        return stimulation.command() if command is None else command

    def _change(self, tick: i64) -> None:
        """Put the parameters in force that act from this tick on."""
        params, change = self._changes.take(tick, self.params)
        self._adopt(params)
        self.state, told = followed(params, self.state, change.keys)
        self._heard += packed(tick, params.period_ns, change.events + told)

    def _adopt(self, params: Params) -> None:
        """Let the loop and what is around it work by other parameters."""
        self.params, self._change_tick = params, self._changes.next_tick
        self.reception.possible = params.possible
        if self._age.most_ns < NEVER:
            self._age.most_ns = params.period_ns * (params.bounds.stale_ticks - 1)

    def plan(self, tick: i64, values: Mapping[str, object], origin: str) -> None:
        """Change parameters from a tick on; without an origin the state has done so already."""
        self._change_tick = self._changes.plan(tick, values, origin)

    def _tell_asker(self, events: Events) -> None:
        """Tell who asked what has become of the command of this tick."""
        self._is_asked, refused = False, dict(events).get(REFUSED)
        mode, tdc_mm = self.state.mode.name.lower(), self.state.set_points.tdc_ref_m * 1e3
        text = refused or f"mode {mode}, set point {tdc_mm:.3f} mm"
        self._commands.answer(refused is None, self.tick, text)

    def _send(self, output: Output) -> bytes:
        """Answer the tick."""
        self._answer = messages(
            self.tick, output.mode, output.machine, output.throttle, output.pulses, self._answer
        )
        frames = self._encoder.encode(self._answer)
        self._link.send(frames)
        return frames

    def _command(self, tick: i64) -> OperatorCommand | None:
        """The operator's command for this tick: from the scenario, or from the command key."""
        if tick >= self._schedule.next_tick:
            is_heard = self.state.stale < self.params.bounds.stale_ticks
            planned = self._schedule.due(may_start=is_heard)
            if planned is not None:
                return planned
        if tick % _COMMAND_EVERY != 0:
            return None
        received = self._commands.poll()
        return None if received is None else self._heard_from(tick, *received)

    def _heard_from(self, tick: i64, origin: str, raw: bytes) -> OperatorCommand | None:
        """The command that came over the command key, unless it is refused."""
        t_ns = tick * self.params.period_ns
        self._heard += topics.COMMAND.pack(tick, t_ns, origin, raw)
        if is_request(raw):
            self._changes.requests.append((origin, raw))
            return None
        try:
            command = parse(raw, origin)
            self._is_asked = command is not None
            return command
        except ConfigError as error:
            text = str(error)
            self._commands.answer(False, tick, text)
            self._heard += topics.EVENT.pack(tick, t_ns, topics.WARNING, "command-refused", text)
            return None

    def _record(
        self, arrival: Arrival, output: Output, frames: bytes, woke_ns: int, asked: bool
    ) -> None:
        """Hand the whole tick to the recorder, after the answer is on its way.

        Parameters: frames : none of a tick that was missed; asked : the law has, in this tick
        """
        tick, state, missed = self.tick, self.state, not frames
        t_ns = tick * self.params.period_ns
        data = packed_tick(
            t_ns, arrival, state, self.reception.slow, output, frames, woke_ns,
            self._pacer.now_ns(), missed,
        )  # fmt: skip
        if asked or self._heard or is_occasion(output):
            data += packed_occasions(tick, t_ns, self.params, state, output, asked) + self._heard
            self._heard = b""
        if not missed and (tick + 1) % self._snapshot_every == 0:
            text = snapshot.dumps(self.remember())
            data += topics.SNAPSHOT.pack(tick + 1, t_ns + self.params.period_ns, text)
        self._recorder.put(data)

    def _note(self, code: str, text: str, batch: bytes, woke_ns: i64) -> None:
        """Log frames that are not acted on, with the time at which that was decided."""
        self._recorder.put(packed_note(max(self.tick, 0), woke_ns, code, text, batch))

    def _tell(self, output: Output) -> None:
        """Publish how the controller is; what belongs to a stroke, of the last finished one."""
        if output.stroke is not None:
            self._finished = output.stroke
        if self.tick % self._status_every != 0:
            return
        status = status_of(
            self.tick, self.params.period_ns, self.state, output, self._finished, self.reception
        )
        self._status.publish(status | {"late_samples": self.late, "changes": self._changes.count})

    def remember(self) -> LoopMemory:
        """Return all that the next turn depends on besides its inputs."""
        sent, received = self._encoder.remember(), self.reception.remember()
        age, changes = self._age.remember(), self._changes.remember()
        stimuli = None if self._stimulation is None else self._stimulation.remember()
        return LoopMemory(self.tick, self.state, sent, received, self.late, age, changes, stimuli)

    def recall(self, memory: LoopMemory) -> None:
        """Go on from what `remember` returned."""
        self.tick, self.state, self.late = memory.tick, memory.state, memory.late
        self._adopt(self._changes.recall(memory.changes, self.params))
        self._encoder.recall(memory.sent)
        self.reception.recall(memory.received)
        self._schedule.pass_over(self.tick + 1)
        self._age.recall(memory.age)
        self._finished = None
        if self._stimulation is not None and memory.stimuli is not None:
            values = self._stimulation.recall(memory.stimuli)
            self._adopt(changed(self.params, values) if values else self.params)
