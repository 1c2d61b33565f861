"""The controller's turn: take the sample, step, send the answer, record, tell.

Driven by the plant's samples; a tick whose sample does not come in time is stepped without one.
Everything that touches the outside goes through a port; the layers are in controller/step.py.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.actuator import messages
from controller.live.stimulation import Stimulation, StimulationMemory
from controller.log import packed_note, packed_occasions, packed_tick
from controller.observe.age import SampleAge
from controller.reception import Arrival, Reception, ReceptionMemory
from controller.state import Inputs, Output, Params, State, StrokeReport
from controller.step import step
from controller.supervisory import Events
from hil import snapshot
from hil.errors import ConfigError
from hil.log import topics
from hil.pacing import Pacer
from hil.ports import Ports, Recorder
from hil.values import NEVER, Value
from hil.wire.codec import Encoder
from hil.wire.commands import OperatorCommand, parse
from hil.wire.messages import Message
from hil.wire.status import ControllerStatus

_COMING_UP_NS: Final = 1_000_000_000
"""For so long at the most the first sample is later than what the scenario orders meanwhile."""

_COMMAND_EVERY: Final = 10


@final
class LoopMemory(Value):
    """All that the next turn depends on besides its inputs: layers, codec, and what was counted."""

    __slots__ = ("tick", "state", "sent", "received", "late", "age", "stimuli")

    def __init__(
        self, tick: i64, state: State, sent: tuple[int, ...], received: ReceptionMemory, late: i64,
        age: tuple[int, int], stimuli: StimulationMemory | None = None,
    ) -> None:  # fmt: skip
        self.tick = tick
        self.state = state
        self.sent = sent
        self.received = received
        self.late = late
        self.age = age
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
        self._schedule = schedule
        self._planned_tick: i64 = min(schedule, default=NEVER)
        self._status_every: i64 = status_every
        self._snapshot_every: i64 = snapshot_every or NEVER
        self._stimulation = stimulation
        self._heard = b""  # records of what was heard on the command key
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
            self._forget_planned(arrival.tick)
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
        command = self._command(arrival.tick)
        if self._stimulation is not None:
            command = self._stimulated(self._stimulation, command)
        if self.reception.doubted:
            self._doubt(self.reception.doubted)
        sample, power_w, fault = arrival.sample, arrival.power_w, arrival.fault
        inputs = Inputs(arrival.tick, sample, command, power_w, fault, arrival.valve)
        self.state, output = step(self.params, self.state, inputs)
        if self._stimulation is not None:
            self._stimulation.note(self.tick, output)
        if self._is_asked:
            self._tell_asker(output.events)
        return output

    def _stimulated(
        self, stimulation: Stimulation, command: OperatorCommand | None
    ) -> OperatorCommand | None:
        """Let the scenario's stimuli change what this tick is stepped with; return its command."""
        t_ns = self.tick * self.params.period_ns
        stimulation.take(self.tick, t_ns, self.state)
        self._heard += stimulation.told
        return stimulation.command() if command is None else command

    def _tell_asker(self, events: Events) -> None:
        """Tell who asked what has become of the command of this tick."""
        self._is_asked = False
        refused = [text for code, text in events if code == "command-refused"]
        mode, tdc_mm = self.state.mode.name.lower(), self.state.set_points.tdc_ref_m * 1e3
        text = refused[0] if refused else f"mode {mode}, set point {tdc_mm:.3f} mm"
        self._commands.answer(not refused, self.tick, text)

    def _doubt(self, why: str) -> None:
        """Log that a sample is not believed, once until they are again."""
        t_ns = self.tick * self.params.period_ns
        self._heard += topics.EVENT.pack(self.tick, t_ns, topics.WARNING, "sample-doubted", why)
        self.reception.doubted = ""

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
        if tick >= self._planned_tick:
            planned = self._planned()
            if planned is not None:
                return planned
        if tick % _COMMAND_EVERY != 0:
            return None
        received = self._commands.poll()
        return None if received is None else self._heard_from(tick, *received)

    def _forget_planned(self, first_tick: i64) -> None:
        """Pass over what was due long before the first sample: a predecessor has done it."""
        due = first_tick - _COMING_UP_NS // self.params.period_ns
        self._planned_tick = min((t for t in self._schedule if t >= due), default=NEVER)

    def _planned(self) -> OperatorCommand | None:
        """The scenario's next order, which may be late: the first sample can be later than it.

        A start waits for samples, as an operator would.
        """
        due_tick = self._planned_tick
        planned = self._schedule[due_tick]
        if planned.kind == "start" and self.state.stale >= self.params.bounds.stale_ticks:
            return None
        self._planned_tick = min((t for t in self._schedule if t > due_tick), default=NEVER)
        return planned

    def _heard_from(self, tick: i64, origin: str, raw: bytes) -> OperatorCommand | None:
        """The command that came over the command key, unless it is refused."""
        t_ns = tick * self.params.period_ns
        self._heard += topics.COMMAND.pack(tick, t_ns, origin, raw)
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
        if asked or self._heard or output.stroke is not None or output.events:
            demand = state.fuelling.demand if asked else None
            data += packed_occasions(tick, t_ns, state.mode, output, demand) + self._heard
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
        state, reception, stroke = self.state, self.reception, self._finished
        status = ControllerStatus(
            mode=state.mode.name.lower(),
            t_s=float(self.tick * self.params.period_ns) * 1e-9,
            tick=self.tick,
            tdc_mm=None if stroke is None else stroke.tdc_m * 1e3,
            tdc_ref_mm=state.set_points.tdc_ref_m * 1e3,
            fuel_mg=None if stroke is None else stroke.demand.fuel_kg * 1e6,
            speed_hz=None if stroke is None else stroke.speed_hz,
            power_w=None if stroke is None else stroke.power_w,
            power_ref_w=None if stroke is None else stroke.power_ref_w,
            load_n_s_m=output.machine.load_n_s_m,
            stale=state.stale,
            late_samples=self.late,
            implausible_samples=reception.implausible,
            reception=reception.decoder.counts()._asdict(),
        )
        self._status.publish(status._asdict())

    def remember(self) -> LoopMemory:
        """Return all that the next turn depends on besides its inputs."""
        sent, received = self._encoder.remember(), self.reception.remember()
        age = self._age.remember()
        stimuli = None if self._stimulation is None else self._stimulation.remember()
        return LoopMemory(self.tick, self.state, sent, received, self.late, age, stimuli)

    def recall(self, memory: LoopMemory) -> None:
        """Go on from what `remember` returned."""
        self.tick, self.state, self.late = memory.tick, memory.state, memory.late
        self._encoder.recall(memory.sent)
        self.reception.recall(memory.received)
        self._planned_tick = min((t for t in self._schedule if t > self.tick), default=NEVER)
        self._age.recall(memory.age)
        self._finished = None
        if self._stimulation is not None and memory.stimuli is not None:
            self._stimulation.recall(memory.stimuli)
