"""Answers to edges in time order; pure, times in plant nanoseconds.

The lines follow hil/wire/pulses.py as the plant's model does: an answer acts at the start of the
tick after it was sent, and when none has acted for as long as the plant waits, all lines are low.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from hil.values import NEVER
from hil.wire import latch, pulses
from hil.wire.messages import CHANNELS, Pulse
from hil.wire.pulses import Edge, PulseOrder


class _Answer(NamedTuple):
    """What acts from an instant on; without a mode, since its head was lost, nothing does."""

    acts_ns: int
    mode: int | None
    sent: list[Pulse]


class EdgeSchedule:
    """What was answered, and the edges that follow from it.

    silence_ns: from the instant at which the last answer acted until all lines are low [ns], and
        stay so until the controller is started again (hil/wire/latch.py), or answers: `rearm`
    """

    def __init__(self, silence_ns: int, rearm: bool = False) -> None:
        self._table = pulses.lines_for(len(CHANNELS))
        self._answers: list[_Answer] = []
        self._silence_ns = silence_ns
        self._low_ns = NEVER
        self._rearm = rearm
        self._latch = latch.RELEASED

    def answer(self, acts_ns: int, mode: int | None, sent: list[Pulse]) -> None:
        """Take an answer, in the order of sending; of several for one tick the newer counts."""
        if self._answers and self._answers[-1].acts_ns >= acts_ns:
            acts_ns, older, pulses_before = self._answers.pop()
            mode = older if mode is None else mode
            sent = pulses.superseded(pulses_before, sent)
        self._answers.append(_Answer(acts_ns, mode, sent))

    def due(self, now_ns: int) -> list[Edge]:
        """Return the edges that are due, in time order, and regard them as done."""
        edges: list[Edge] = []
        while self._answers and self._answers[0].acts_ns <= now_ns:
            acts_ns, mode, sent = self._answers.pop(0)
            if mode is None:
                continue
            if self._low_ns < acts_ns:
                edges += self._fall_silent()
            fires = pulses.may_fire(mode)
            self._latch = latch.after_answer(self._latch, fires)
            if self._latch == latch.RELEASED:
                edges += self._follow(fires, pulses.orders_of(sent), acts_ns)
            self._low_ns = acts_ns + self._silence_ns
        if self._low_ns <= now_ns:
            edges += self._fall_silent()
            self._low_ns = NEVER
        return edges + self._passed(now_ns)

    def _fall_silent(self) -> list[Edge]:
        """Let all lines be low when the silence has lasted."""
        self._latch = latch.RELEASED if self._rearm else latch.LATCHED
        return self._follow(False, (), self._low_ns)

    def _follow(self, fires: bool, orders: tuple[PulseOrder, ...], at_ns: int) -> list[Edge]:
        """Let the lines follow what is said of them at an instant."""
        before = self._passed(at_ns)
        self._table, _ = pulses.follow(self._table, fires, orders, at_ns)
        return before + self._passed(at_ns)

    def _passed(self, to_ns: int) -> list[Edge]:
        self._table, edges = pulses.advance(self._table, to_ns)
        return list(edges)

    def next_ns(self) -> int:
        """Return when the next edge is due, what acts by then included; NEVER for none."""
        table, shut = self._table, self._latch
        for acts_ns, mode, sent in self._answers:
            if table.next_edge_ns <= acts_ns:
                break
            if mode is not None:
                fires, orders = pulses.may_fire(mode), pulses.orders_of(sent)
                shut = latch.after_answer(shut, fires)
                if shut == latch.RELEASED:
                    table, _ = pulses.follow(table, fires, orders, acts_ns)
        return NEVER if table.next_edge_ns == NEVER else min(table.next_edge_ns, self._low_ns)


class PlantClock:
    """The plant's time from the arrivals of its samples: the earliest phase, forgetting slowly.

    offset' = min(offset + drift, arrival - tick T), so that one late arrival moves it by nothing
    """

    def __init__(self, period_ns: int, phase_ns: int) -> None:
        self._period_ns = period_ns
        self._phase_ns = phase_ns
        self._drift_ns = max(period_ns // 20_000, 1)  # 50 ppm
        self._offset_ns = NEVER

    def arrived(self, tick: int, arrival_ns: int) -> bool:
        """Take note of a sample's arrival on the monotonic clock [ns]; true when time is new."""
        offset_ns = arrival_ns - tick * self._period_ns
        anew = abs(offset_ns - self._offset_ns) > _RESTART_NS
        if anew:
            self._offset_ns = offset_ns
        self._offset_ns = min(self._offset_ns + self._drift_ns, offset_ns)
        return anew

    def plant_ns(self, monotonic_ns: int) -> int:
        """Return the plant's time at an instant of the monotonic clock [ns]."""
        return monotonic_ns - self._offset_ns + self._phase_ns

    def tick_after(self, monotonic_ns: int) -> int:
        """Return the first tick that begins at or after an instant of the monotonic clock."""
        return -(-self.plant_ns(monotonic_ns) // self._period_ns)

    def monotonic_ns(self, plant_ns: int) -> int:
        """Return the instant of the monotonic clock at a time of the plant [ns]."""
        return plant_ns + self._offset_ns - self._phase_ns


_RESTART_NS: Final = 100_000_000
