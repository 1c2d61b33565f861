"""From the plant's frames to a sample: decoded, of one tick, and believed."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.mode.start_restart import GENERATING, MOTORING
from controller.observe.plausibility import NAMES, NONE, UNHEARD_OF, Witness, fault_of, judge
from controller.observe.possible import Possible
from controller.observe.symptoms import watch
from controller.state import Inputs, State
from hil.values import Value
from hil.wire.codec import Decoder, DecoderMemory
from hil.wire.commands import OperatorCommand
from hil.wire.e2e import MAX_DELTA
from hil.wire.messages import (
    ELECTRIC_POWER,
    P_LEFT,
    P_RIGHT,
    CylinderPeak,
    PistonSample,
    PlantTick,
    ValveMove,
)

_NAN: Final = float("nan")
_TICK_MODULO: Final = 1 << 32
_LARGEST_GAP_NS: Final = 60_000_000_000
"""A tick further ahead than this is no plant's that was only away for a while."""


@final
class Arrival(Value):
    """What came for a tick: its frames, the sample if it may be used, and the electric power.

    tick: -1 when its head did not come through; power_w: nan when the frames carried none; fault:
    what the samples show to be wrong; told: what a valve's position switch, or an indicator, told
    winding_k: as power_w
    """

    __slots__ = ("tick", "batch", "sample", "power_w", "fault", "told", "winding_k")

    def __init__(
        self, tick: int, batch: bytes, sample: PistonSample | None = None, power_w: float = _NAN,
        fault: i64 = NONE, told: ValveMove | CylinderPeak | None = None, winding_k: float = _NAN,
    ) -> None:  # fmt: skip
        self.tick = tick
        self.batch = batch
        self.sample = sample
        self.power_w = power_w
        self.fault = fault
        self.told = told
        self.winding_k = winding_k

    def inputs(self, command: OperatorCommand | None) -> Inputs:
        """What the step takes of it."""
        return Inputs(
            self.tick, self.sample, command, self.power_w, self.fault, self.told, self.winding_k
        )


@final
class ReceptionMemory(Value):
    """All that the next arrival depends on besides its frames, and what was counted."""

    __slots__ = ("decoder", "slow", "silent_turns", "witness", "out_of_step", "implausible")

    def __init__(
        self, decoder: DecoderMemory, slow: tuple[float, ...], silent_turns: int,
        witness: Witness, out_of_step: int, implausible: int,
    ) -> None:  # fmt: skip
        self.decoder = decoder
        self.slow = slow
        self.silent_turns = silent_turns
        self.witness = witness
        self.out_of_step = out_of_step
        self.implausible = implausible


class Reception:
    """Takes the plant's batches; `slow` is electric power, pressure left and right, as last heard.

    out_of_step, implausible: samples that were intact and not used; doubted: why, for the log
    """

    def __init__(self, period_ns: int, possible: Possible, every_stroke: bool = True) -> None:
        self.decoder = Decoder("plant")
        self.slow = [0.0, 0.0, 0.0]
        self.out_of_step = self.implausible = 0
        self._period_ns = period_ns
        self._largest_gap = _LARGEST_GAP_NS // period_ns
        self._silent_turns = 0
        self.possible = possible
        self._every_stroke = every_stroke
        self.witness = UNHEARD_OF
        self.doubted = ""

    def take(self, batch: bytes | None, last_tick: int, state: State) -> Arrival:
        """Decode a batch; None is a turn in which none came.

        Parameters: last_tick : -1 before the first; state : with the last sample that was used
        """
        if batch is None:
            self._silent_turns += 1
            if self._silent_turns == MAX_DELTA:
                self.decoder.forget_counters()
            return Arrival(-1, b"")
        self._silent_turns = 0
        tick, sample, power_w, winding_k, told = -1, None, _NAN, _NAN, None
        for message in self.decoder.decode(batch):
            if type(message) is PlantTick:
                tick = self._whole_tick(message.tick, last_tick)
                power_w, winding_k = message.electric_power_w, message.winding_k
                self._hear(message)
            elif type(message) is PistonSample:
                sample = message
            elif type(message) is ValveMove or type(message) is CylinderPeak:
                told = message
        if sample is None or tick <= last_tick:
            return Arrival(tick, batch)
        return self._judged(tick, batch, sample, power_w, winding_k, state, told)

    def _judged(
        self, tick: int, batch: bytes, sample: PistonSample, power_w: float,
        winding_k: float, state: State, told: ValveMove | CylinderPeak | None,
    ) -> Arrival:  # fmt: skip
        """What an intact sample is worth: of the tick of its head, and believed."""
        if not self.decoder.in_step():
            self.out_of_step += 1
            return Arrival(tick, batch)
        fault = self._judge(tick, sample, power_w, state)
        if self.witness.agreeing == 0:
            return Arrival(tick, batch, sample, power_w, fault, told, winding_k)
        self.implausible += 1
        return Arrival(tick, batch, None, power_w, fault)

    def _hear(self, head: PlantTick) -> None:
        """Keep the slow signal that a head carries."""
        slow = head.slow
        if slow == ELECTRIC_POWER:
            self.slow[ELECTRIC_POWER] = head.electric_power_w
        elif slow == P_LEFT:
            self.slow[P_LEFT] = head.p_left_pa
        elif slow == P_RIGHT:
            self.slow[P_RIGHT] = head.p_right_pa

    def _judge(self, tick: int, sample: PistonSample, power_w: float, state: State) -> i64:
        """Let the witness see a sample; returns the fault that it shows."""
        t_ns, motion, operation = tick * self._period_ns, state.motion, state.operation
        active = operation.mode is MOTORING or operation.mode is GENERATING
        doubted = self.witness.doubt
        self.witness = judge(
            self.possible, self.witness, motion, t_ns, sample.x_m, sample.v_m_s, active
        )
        if doubted == NONE and self.witness.doubt != NONE and active:
            self.doubted = NAMES[self.witness.doubt]
        if not active:
            return NONE
        if self.witness.agreeing:
            return fault_of(self.possible, self.witness)
        self.witness, fault = watch(
            self.possible, self.witness, motion, sample.v_m_s, power_w,
            state.set_points.load_n_s_m, t_ns - operation.since_t_ns, operation.mode is GENERATING,
            self._every_stroke and operation.fired_t_ns < 0, operation.misfires,
        )  # fmt: skip
        return fault or fault_of(self.possible, self.witness)

    def _whole_tick(self, low: int, last: int) -> int:
        """The tick of which the wire carries 32 bits, nearest to the last; -1 if far ahead."""
        if last < 0 or low == last + 1:
            return low
        half = _TICK_MODULO // 2
        ahead = (low - last + half) % _TICK_MODULO - half
        return max(last + ahead, 0) if ahead <= self._largest_gap else -1

    def remember(self) -> ReceptionMemory:
        """Return all that the next arrival depends on besides its frames."""
        return ReceptionMemory(
            self.decoder.remember(), tuple(self.slow), self._silent_turns, self.witness,
            self.out_of_step, self.implausible,
        )  # fmt: skip

    def recall(self, memory: ReceptionMemory) -> None:
        """Go on from what `remember` returned."""
        self.decoder.recall(memory.decoder)
        self.slow, self._silent_turns = list(memory.slow), memory.silent_turns
        self.witness = memory.witness
        self.out_of_step, self.implausible = memory.out_of_step, memory.implausible
