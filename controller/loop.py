"""The controller's turn: take the sample, step, answer, record.

Driven by the plant's samples; a tick whose sample does not come in time is stepped without one.
Everything that touches the outside goes through a port; the layers are in controller/step.py.
"""

from __future__ import annotations

from typing import Any, Final

from controller.commands import OperatorCommand, parse
from controller.memory import LoopMemory
from controller.plausibility import CLEAR, judge
from controller.start_restart import Mode
from controller.state import Inputs, Output, Params, State, StrokeReport
from controller.step import step
from controller.timing import PlannedPulse
from hil import snapshot, topics
from hil.codec import Decoder, Encoder
from hil.e2e import MAX_DELTA
from hil.errors import ConfigError
from hil.messages import PistonSample, PlantTick
from hil.pacing import NEVER, Pacer
from hil.ports import CommandSource, Link, Recorder, StatusSink
from hil.records import together

MAX_LOGGED: Final = 4
"""Pulses of one tick that its record has room for."""

_NAN: Final = float("nan")
_NO_PULSES: Final = (0,) * 13  # none of them, then channels, openings and durations
_PADDING: Final = (PlannedPulse(0, 0, 0),) * MAX_LOGGED
_PACK_TICK: Final = together(topics.SENSOR, topics.ACTUATOR, topics.TIMING)
_COMMAND_EVERY: Final = 10
_TICK_MODULO: Final = 1 << 32
_FAULT_MODES: Final = (Mode.SAFE,)
_LARGEST_GAP_NS: Final = 60_000_000_000
"""A tick further ahead than this is no plant's that was only away for a while."""


class ControllerLoop:
    """One controller on one link; `turn` answers one batch."""

    def __init__(
        self,
        params: Params,
        state: State,
        *,
        link: Link,
        pacer: Pacer,
        recorder: Recorder,
        status: StatusSink,
        commands: CommandSource,
        schedule: dict[int, OperatorCommand],
        status_every: int,
        peer_timeout_s: float,
        snapshot_every: int = 0,
    ) -> None:
        self.params = params
        self.state = state
        self.tick = -1
        self.peer_timeout_s = peer_timeout_s
        self._link = link
        self._pacer = pacer
        self._put = recorder.put
        self._status = status
        self._commands = commands
        self._schedule = schedule
        self._status_every = status_every
        self._encoder = Encoder()
        self.decoder = Decoder("plant")
        self._last_sample = PistonSample(0.0, 0.0)
        self._slow = [0.0, 0.0, 0.0]  # electric power, pressure left and right, as last heard
        self._power = _NAN  # of this tick's frames
        self.late = 0
        self.out_of_step = self.implausible = 0  # samples that were intact and not used
        self._credence = CLEAR
        self._silent_turns = 0
        self._snapshot_every = snapshot_every or NEVER
        self._demand = state.demand
        self._heard = b""
        self._largest_gap = _LARGEST_GAP_NS // params.period_ns

    def turn(self, batch: bytes | None) -> None:
        """Answer a batch, or the tick that is due when none came in time."""
        woke_ns = self._pacer.now_ns()
        tick, sample = self._understand(batch)
        expected = self.tick + 1
        if self.tick < 0 and batch is not None:
            if tick < 0:
                self._note("sample-refused", "first frames without a valid head", batch)
                return
            self._pacer.start(tick)
            expected = tick
        if 0 <= tick < expected:
            self.late += 1
            text = f"sample of tick {tick} came after tick {self.tick} was answered without it"
            self._note("sample-late", text, batch or b"")
            return
        for missed in range(expected, tick):
            self._advance(missed, None, b"", woke_ns, answer=False)
        self._advance(max(tick, expected), sample, batch or b"", woke_ns, answer=True)

    def _understand(self, batch: bytes | None) -> tuple[int, PistonSample | None]:
        """Decode a batch: (tick, sample); tick -1 when its head did not come through."""
        if batch is None:
            self._silent_turns += 1
            if self._silent_turns == MAX_DELTA:
                self.decoder.forget_counters()
            return -1, None
        self._silent_turns = 0
        tick, sample = -1, None
        self._power = _NAN
        for message in self.decoder.decode(batch):
            if type(message) is PlantTick:
                tick = self._whole_tick(message.tick)
                self._slow[message.slow] = message[3 + message.slow]
                self._power = message.electric_power_w
            elif type(message) is PistonSample:
                sample = message
        if sample is None or tick < 0:
            return tick, None
        return tick, sample if tick <= self.tick or self._is_believed(tick, sample) else None

    def _is_believed(self, tick: int, sample: PistonSample) -> bool:
        """Whether an intact sample is of the tick of its head, and can follow the last one."""
        if not self.decoder.in_step():
            self.out_of_step += 1
            return False
        motion = self.state.motion
        self._credence, believed = judge(
            self._credence, motion.t_ns, motion.x_m, motion.v_m_s,
            tick * self.params.period_ns, sample.x_m, sample.v_m_s,
        )  # fmt: skip
        self.implausible += not believed
        return believed

    def _whole_tick(self, low: int) -> int:
        """The tick of which the wire carries 32 bits, nearest to the last; -1 if far ahead."""
        if self.tick < 0 or low == self.tick + 1:
            return low
        half = _TICK_MODULO // 2
        ahead = (low - self.tick + half) % _TICK_MODULO - half
        return max(self.tick + ahead, 0) if ahead <= self._largest_gap else -1

    def _advance(
        self, tick: int, sample: PistonSample | None, batch: bytes, woke_ns: int, *, answer: bool
    ) -> None:
        """Step one tick, answer it unless its time is over, record it."""
        self.tick = tick
        command = self._command(tick)
        power = _NAN if sample is None else self._power
        self.state, output = step(self.params, self.state, Inputs(tick, sample, command, power))
        frames = b""
        if answer:
            frames = self._encoder.encode(output.messages)
            self._link.send(frames)
        done_ns = self._pacer.now_ns()
        self._record(tick, sample, batch, frames, output, (woke_ns, done_ns), missed=not answer)
        if tick % self._status_every == 0:
            self._tell(tick, output.stroke)

    def _command(self, tick: int) -> OperatorCommand | None:
        """The operator's command for this tick: from the scenario, or from the command key."""
        planned = self._schedule.get(tick)
        if planned is not None:
            return planned
        if tick % _COMMAND_EVERY:
            return None
        received = self._commands.poll()
        if received is None:
            return None
        origin, raw = received
        t_ns = tick * self.params.period_ns
        self._heard = topics.COMMAND.pack(tick, t_ns, origin, raw)
        try:
            return parse(raw, origin)
        except ConfigError as error:
            text = str(error)
            self._heard += topics.EVENT.pack(tick, t_ns, topics.WARNING, "command-refused", text)
            return None

    def _record(
        self,
        tick: int,
        sample: PistonSample | None,
        batch: bytes,
        frames: bytes,
        output: Output,
        times_ns: tuple[int, int],
        *,
        missed: bool,
    ) -> None:
        """Hand the whole tick to the recorder, after the answer is on its way."""
        t_ns = tick * self.params.period_ns
        woke_ns, done_ns = times_ns
        if sample is not None:
            self._last_sample = sample
        x_m, v_m_s = self._last_sample
        power, left, right = self._slow
        status = _status_of(sample, batch)
        used = tick if sample is not None else -1
        mode, force_n, load_n_s_m = output.machine
        data = _PACK_TICK(
            tick, t_ns, x_m, v_m_s, left, right, power, status,
            tick, mode, force_n, load_n_s_m, output.throttle, *_columns_of(output.pulses),
            t_ns, woke_ns, done_ns, used, missed,
        )  # fmt: skip
        if batch:
            data += topics.FRAMES_RECEIVED.pack(tick, t_ns, batch)
        if frames:
            data += topics.FRAMES_SENT.pack(tick, t_ns, frames)
        if output.stroke or output.events or self._heard or self.state.demand is not self._demand:
            data += self._packed_occasions(tick, t_ns, output)
        if not missed and (tick + 1) % self._snapshot_every == 0:
            text = snapshot.dumps(self.remember())
            data += topics.SNAPSHOT.pack(tick + 1, t_ns + self.params.period_ns, text)
        self._put(data)

    def _packed_occasions(self, tick: int, t_ns: int, output: Output) -> bytes:
        """What happens in few ticks: a stroke ends, the law answers, a mode changes, a command."""
        data = b""
        if output.stroke is not None:
            data += _packed_stroke(tick, t_ns, output.stroke)
        demand = self.state.demand
        if demand is not self._demand:
            self._demand = demand
            if demand.fuel_kg > 0.0:
                data += topics.DEMAND.pack(tick, t_ns, demand.fuel_kg, demand.v_ref_m_s)
        for code, text in output.events:
            severity = topics.FAULT if self.state.mode in _FAULT_MODES else topics.INFO
            data += topics.EVENT.pack(tick, t_ns, severity, code, text)
        if self._heard:
            data += self._heard
            self._heard = b""
        return data

    def remember(self) -> LoopMemory:
        """Return all that the next turn depends on besides its inputs."""
        return LoopMemory(
            self.tick, self.state, self._encoder.remember(), self.decoder.remember(),
            self._last_sample, tuple(self._slow), self._power, self.late, self._silent_turns,
            self._credence, (self.out_of_step, self.implausible),
        )  # fmt: skip

    def recall(self, memory: LoopMemory) -> None:
        """Go on from what `remember` returned."""
        self.tick, self.state, sent, received, self._last_sample = memory[:5]
        self._encoder.recall(sent)
        self.decoder.recall(received)
        self._slow, self._power = list(memory.slow), memory.power_w
        self.late, self._silent_turns = memory.late, memory.silent_turns
        self._credence = memory.credence
        self.out_of_step, self.implausible = memory.doubted
        self._demand = self.state.demand

    def _note(self, code: str, text: str, batch: bytes) -> None:
        """Frames that are logged and never acted on, such as those of a tick already stepped."""
        tick = max(self.tick, 0)
        t_ns = tick * self.params.period_ns
        self._put(
            topics.FRAMES_RECEIVED.pack(tick, t_ns, batch)
            + topics.EVENT.pack(tick, t_ns, topics.WARNING, code, text)
        )

    def _tell(self, tick: int, stroke: StrokeReport | None) -> None:
        """Publish how the controller is."""
        state = self.state
        self._status.publish(
            {
                "tick": tick,
                "t_s": tick * self.params.period_ns * 1e-9,
                "mode": state.mode.name.lower(),
                "tdc_mm": state.motion.tdc_m * 1e3,
                "tdc_ref_mm": state.set_points.tdc_ref_m * 1e3,
                "fuel_mg": state.demand.fuel_kg * 1e6,
                "load_n_s_m": state.set_points.load_n_s_m,
                "stale": state.stale,
                "late_samples": self.late,
                "implausible_samples": self.implausible,
                "reception": self.decoder.counts()._asdict(),
            }
        )


def _status_of(sample: PistonSample | None, batch: bytes) -> int:
    """How the log marks the sample of a tick."""
    if sample is not None:
        return topics.SAMPLE_FRESH
    return topics.SAMPLE_INVALID if batch else topics.SAMPLE_NONE


def _columns_of(pulses: tuple[PlannedPulse, ...]) -> tuple[int, ...]:
    """How many pulses there are, then their channels, openings and durations, four of each."""
    if not pulses:
        return _NO_PULSES
    columns = zip(*(*pulses, *_PADDING)[:MAX_LOGGED], strict=True)
    channels, opens, durations = columns
    return (min(len(pulses), MAX_LOGGED), *channels, *opens, *durations)


def _packed_stroke(tick: int, t_ns: int, stroke: StrokeReport) -> bytes:
    """One finished stroke with the terms of both loops."""
    demand: Any = stroke.demand
    return topics.STROKE.pack(
        stroke.number, tick, t_ns, stroke.side, stroke.tdc_m, stroke.tdc_ref_m, stroke.v_mid_m_s,
        demand.v_ref_m_s, demand.fuel_kg, demand.outer_p_m_s, demand.outer_i_m_s,
        demand.inner_p_kg, demand.inner_i_kg,
    )  # fmt: skip
