"""From the plant's frames to a sample: decoded, of one tick, and believed."""

from __future__ import annotations

from typing import Final, final

from controller.observe.estimate import Motion
from controller.observe.plausibility import CLEAR, Credence, judge
from hil.values import Value
from hil.wire.codec import Decoder, DecoderMemory
from hil.wire.e2e import MAX_DELTA
from hil.wire.messages import P_LEFT, P_RIGHT, PistonSample, PlantTick

_NAN: Final = float("nan")
_TICK_MODULO: Final = 1 << 32
_LARGEST_GAP_NS: Final = 60_000_000_000
"""A tick further ahead than this is no plant's that was only away for a while."""


@final
class Arrival(Value):
    """What came for a tick: its frames, the sample if it may be used, and the electric power.

    tick: -1 when its head did not come through; power_w: nan when the frames carried none
    """

    __slots__ = ("tick", "batch", "sample", "power_w")

    def __init__(
        self, tick: int, batch: bytes, sample: PistonSample | None = None, power_w: float = _NAN
    ) -> None:
        self.tick = tick
        self.batch = batch
        self.sample = sample
        self.power_w = power_w


@final
class ReceptionMemory(Value):
    """All that the next arrival depends on besides its frames, and what was counted."""

    __slots__ = ("decoder", "slow", "silent_turns", "credence", "out_of_step", "implausible")

    def __init__(
        self, decoder: DecoderMemory, slow: tuple[float, ...], silent_turns: int,
        credence: Credence, out_of_step: int, implausible: int,
    ) -> None:  # fmt: skip
        self.decoder = decoder
        self.slow = slow
        self.silent_turns = silent_turns
        self.credence = credence
        self.out_of_step = out_of_step
        self.implausible = implausible


class Reception:
    """Takes the plant's batches; `slow` is electric power, pressure left and right, as last heard.

    out_of_step, implausible: samples that were intact and not used
    """

    def __init__(self, period_ns: int) -> None:
        self.decoder = Decoder("plant")
        self.slow = [0.0, 0.0, 0.0]
        self.out_of_step = self.implausible = 0
        self._period_ns = period_ns
        self._largest_gap = _LARGEST_GAP_NS // period_ns
        self._silent_turns = 0
        self._credence = CLEAR

    def take(self, batch: bytes | None, last_tick: int, motion: Motion) -> Arrival:
        """Decode a batch; None is a turn in which none came.

        Parameters: last_tick : -1 before the first; motion : as of the last sample that was used
        """
        if batch is None:
            self._silent_turns += 1
            if self._silent_turns == MAX_DELTA:
                self.decoder.forget_counters()
            return Arrival(-1, b"")
        self._silent_turns = 0
        tick, sample, power_w = -1, None, _NAN
        for message in self.decoder.decode(batch):
            if type(message) is PlantTick:
                tick = self._whole_tick(message.tick, last_tick)
                power_w = message.electric_power_w
                self._hear(message)
            elif type(message) is PistonSample:
                sample = message
        if sample is None or tick <= last_tick or not self._is_believed(tick, sample, motion):
            return Arrival(tick, batch)
        return Arrival(tick, batch, sample, power_w)

    def _hear(self, head: PlantTick) -> None:
        """Keep the slow signal that a head carries."""
        carried = head.electric_power_w
        if head.slow == P_LEFT:
            carried = head.p_left_pa
        elif head.slow == P_RIGHT:
            carried = head.p_right_pa
        self.slow[head.slow] = carried

    def _is_believed(self, tick: int, sample: PistonSample, motion: Motion) -> bool:
        """Whether an intact sample is of the tick of its head, and can follow the last one."""
        if not self.decoder.in_step():
            self.out_of_step += 1
            return False
        self._credence, believed = judge(
            self._credence, motion.t_ns, motion.x_m, motion.v_m_s,
            tick * self._period_ns, sample.x_m, sample.v_m_s,
        )  # fmt: skip
        self.implausible += not believed
        return believed

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
            self.decoder.remember(), tuple(self.slow), self._silent_turns, self._credence,
            self.out_of_step, self.implausible,
        )  # fmt: skip

    def recall(self, memory: ReceptionMemory) -> None:
        """Go on from what `remember` returned."""
        self.decoder.recall(memory.decoder)
        self.slow, self._silent_turns = list(memory.slow), memory.silent_turns
        self._credence = memory.credence
        self.out_of_step, self.implausible = memory.out_of_step, memory.implausible
