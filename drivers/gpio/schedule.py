"""Pulses by channel to edges in time order; pure, times in plant nanoseconds.

A pulse is sent again every tick until it has closed: an identical one changes nothing, a newer one
replaces what is not yet due, an open pulse's closing included.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from hil.wire.messages import PULSE_CLOCK_US

NEVER: Final = 1 << 62


class Edge(NamedTuple):
    """A line that changes."""

    due_ns: int
    channel: int
    high: bool


class _Pulse(NamedTuple):
    open_ns: int
    close_ns: int
    is_open: bool = False


def unwrapped_ns(open_us: int, now_ns: int) -> int:
    """Return the instant nearest to now that the wire's 20 bits of microseconds mean [ns]."""
    half = PULSE_CLOCK_US // 2
    now_us = now_ns // 1000
    return (now_us + (open_us - now_us + half) % PULSE_CLOCK_US - half) * 1000


class EdgeSchedule:
    """What each channel is to do next.

    late_ns: openings known only so long after their instant are left out [ns]
    """

    def __init__(self, channels: frozenset[int], late_ns: int) -> None:
        self._pulses: dict[int, _Pulse] = {}
        self._closed_ns = dict.fromkeys(channels, -NEVER)
        self._late_ns = late_ns
        self.late = 0

    def order(self, channel: int, open_ns: int, close_ns: int, now_ns: int) -> None:
        """Take a pulse of the wire."""
        if channel not in self._closed_ns:
            return
        pulse = self._pulses.get(channel)
        if pulse is not None and pulse.is_open:
            self._pulses[channel] = pulse._replace(close_ns=close_ns)
        elif open_ns <= self._closed_ns[channel]:
            return  # the pulse that is over, or one from before its end
        elif now_ns - open_ns > self._late_ns:
            self.late += 1
            self._closed_ns[channel] = open_ns
            self._pulses.pop(channel, None)
        else:
            self._pulses[channel] = _Pulse(open_ns, close_ns)

    def due(self, now_ns: int) -> list[Edge]:
        """Return the edges that are due, in time order, and regard them as done."""
        edges = []
        for channel, pulse in list(self._pulses.items()):
            if not pulse.is_open and pulse.open_ns <= now_ns:
                edges.append(Edge(pulse.open_ns, channel, high=True))
                pulse = self._pulses[channel] = pulse._replace(is_open=True)  # noqa: PLW2901
            if pulse.is_open and pulse.close_ns <= now_ns:
                edges.append(Edge(pulse.close_ns, channel, high=False))
                del self._pulses[channel]
                self._closed_ns[channel] = max(pulse.open_ns, pulse.close_ns)
        edges.sort()
        return edges

    def next_ns(self) -> int:
        """Return when the next edge is due; NEVER when none is."""
        return min((p.close_ns if p.is_open else p.open_ns for p in self._pulses.values()),
                   default=NEVER)  # fmt: skip

    def clear(self, now_ns: int) -> None:
        """Forget everything that is not done; what is repeated of it stays forgotten."""
        for channel, pulse in self._pulses.items():
            self._closed_ns[channel] = max(pulse.open_ns, now_ns if pulse.is_open else 0)
        self._pulses.clear()


class PlantClock:
    """The plant's time from the arrivals of its samples: the earliest phase, forgetting slowly.

    offset' = min(offset + drift, arrival - tick T), so that one late arrival moves it by nothing
    """

    def __init__(self, period_ns: int, phase_ns: int) -> None:
        self._period_ns = period_ns
        self._phase_ns = phase_ns
        self._drift_ns = max(period_ns // 20_000, 1)  # 50 ppm
        self._offset_ns = NEVER

    def arrived(self, tick: int, arrival_ns: int) -> None:
        """Take note of the arrival of a tick's sample on the monotonic clock [ns]."""
        offset_ns = arrival_ns - tick * self._period_ns
        if abs(offset_ns - self._offset_ns) > _RESTART_NS:
            self._offset_ns = offset_ns  # the plant was started anew
        self._offset_ns = min(self._offset_ns + self._drift_ns, offset_ns)

    def plant_ns(self, monotonic_ns: int) -> int:
        """Return the plant's time at an instant of the monotonic clock [ns]."""
        return monotonic_ns - self._offset_ns + self._phase_ns

    def monotonic_ns(self, plant_ns: int) -> int:
        """Return the instant of the monotonic clock at a time of the plant [ns]."""
        return plant_ns + self._offset_ns - self._phase_ns


_RESTART_NS: Final = 100_000_000
