"""The process that drives the TTL lines: fed with the frames that are sent, edges placed by time.

It holds the lines low before the first frame, in a mode that does not fire, after silence, when the
loop's process is gone, and when it ends. After its kill drivers/gpio/low.py does.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import struct
import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import Final

from drivers.gpio.lines import GpiodLines, Lines
from drivers.gpio.schedule import EdgeSchedule, PlantClock
from drivers.recorder.ring import Consumer
from drivers.system.process import guarded
from drivers.system.realtime import prepare
from hil.config.hardware import OutputsConfig
from hil.config.process import RealtimeConfig
from hil.wire.codec import Decoder
from hil.wire.e2e import MAX_DELTA
from hil.wire.messages import ControllerTick, Pulse
from hil.wire.pulses import Edge

HEAD: Final = struct.Struct("<qqH")
"""Arrival of the sample that is answered, 0 for none, and sending [ns]; bytes of frames."""
_READ_BYTES: Final = 1 << 16
_NAP_NS: Final = 250_000


class EdgeDriver:
    """Frames to edges on lines; knows nothing of processes.

    period_ns, stale_ticks : the plant's tick, and how many without an answer it waits
    rearm : lines act again when answers return, and need no start
    """

    def __init__(
        self, lines: Lines, config: OutputsConfig, period_ns: int, stale_ticks: int,
        rearm: bool = False,
    ) -> None:  # fmt: skip
        self._lines = lines
        self._late_ns = config.late_us * 1000
        self._period_ns = period_ns
        self._silence_ns = stale_ticks * period_ns
        if config.silence_s is not None:
            self._silence_ns = min(self._silence_ns, round(config.silence_s * 1e9))
        self._clock = PlantClock(period_ns, config.phase_us * 1000)
        self._decoder = Decoder("controller")
        self._rearm = rearm
        self._schedule = EdgeSchedule(self._silence_ns, rearm)
        self._tick = 0
        self.late = 0
        """Openings that were left out, since it was too late for them."""

    def take(self, arrival_ns: int, sent_ns: int, batch: bytes) -> None:
        """Take the frames of one answer, which act from the tick on that begins next.

        Parameters: arrival_ns : when the sample came, 0 for none; sent_ns : when the answer left,
            both on the monotonic clock [ns]
        """
        if self._clock.tick_after(sent_ns) - self._tick > MAX_DELTA:
            self._decoder.forget_counters()
        tick, mode = -1, None
        pulses: list[Pulse] = []
        for message in self._decoder.decode(batch):
            if isinstance(message, ControllerTick):
                tick, mode = message.tick, message.mode
            elif isinstance(message, Pulse):
                pulses.append(message)
        if mode is not None and arrival_ns and self._clock.arrived(tick, arrival_ns):
            self.rest()
        self._tick = max(tick + 1, self._clock.tick_after(sent_ns))
        self._schedule.answer(self._tick * self._period_ns, mode, pulses)

    def act(self, now_ns: int) -> int:
        """Place the edges that are due; return when to look again on the monotonic clock [ns]."""
        plant_ns = self._clock.plant_ns(now_ns)
        for edge in self._schedule.due(plant_ns):
            self._place(edge, plant_ns)
        return min(self._clock.monotonic_ns(self._schedule.next_ns()), now_ns + _NAP_NS)

    def _place(self, edge: Edge, plant_ns: int) -> None:
        """Change a line; an opening that comes too late is left out."""
        if edge.channel not in self._lines.channels:
            return
        if edge.high and plant_ns - edge.t_ns > self._late_ns:
            self.late += 1
            return
        self._lines.set(edge.channel, edge.high)

    def rest(self) -> None:
        """Forget what was ordered and let all lines be low."""
        self._schedule = EdgeSchedule(self._silence_ns, self._rearm)
        self._lines.all_low()


def split(data: bytes) -> tuple[list[tuple[int, int, bytes]], bytes]:
    """Return (arrival, sent, frames) of the whole records in the ring's bytes, and the rest."""
    records, at = [], 0
    while at + HEAD.size <= len(data):
        arrival_ns, sent_ns, size = HEAD.unpack_from(data, at)
        end = at + HEAD.size + size
        if end > len(data):
            break
        records.append((arrival_ns, sent_ns, data[at + HEAD.size : end]))
        at = end
    return records, data[at:]


def drive(driver: EdgeDriver, ring: Consumer, spin_ns: int, goes_on: Callable[[], bool]) -> None:
    """Read, act and sleep until told to end."""
    rest = b""
    now = time.monotonic_ns
    while goes_on():
        if data := ring.read(_READ_BYTES):
            records, rest = split(rest + data)
            for arrival_ns, sent_ns, batch in records:
                driver.take(arrival_ns, sent_ns, batch)
        due_ns = driver.act(now())
        asleep_ns = min(due_ns - spin_ns - now(), _NAP_NS)
        if asleep_ns > 0:
            time.sleep(asleep_ns * 1e-9)
        else:
            while now() < due_ns:
                pass


class _Life:
    """Until asked to end, told that nothing more comes, or orphaned."""

    def __init__(self, parent: int, ring: Consumer) -> None:
        self._parent = parent
        self._ring = ring
        self._asked = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._end)

    def _end(self, _number: int, _frame: FrameType | None) -> None:
        self._asked = True

    def goes_on(self) -> bool:
        """Whether there is a reason to go on."""
        return not (self._asked or self._ring.closed or os.getppid() != self._parent)


def serve(told: dict[str, object]) -> int:
    """Drive the lines for the process that started this one.

    Raises: MissingExtraError, ConfigError, RunError
    """
    config = OutputsConfig.model_validate(told["outputs"])
    ring = Consumer(int(str(told["ring"])))
    life = _Life(int(str(told["parent"])), ring)
    lines = GpiodLines(config)
    try:
        prepare(RealtimeConfig(priority=config.priority))
        period_ns, stale_ticks = int(str(told["period_ns"])), int(str(told["stale_ticks"]))
        rearm = told["rearm"] is True
        driver = EdgeDriver(lines, config, period_ns, stale_ticks, rearm)
        print("ready", flush=True)
        drive(driver, ring, round(config.spin_s * 1e9), life.goes_on)
    finally:
        lines.close()
    return 0


def run(argv: list[str] | None = None) -> int:
    """Read the arguments and do what they say."""
    parser = argparse.ArgumentParser(prog="gpio")
    parser.add_argument("--serve", metavar="JSON", required=True, help="what OutputProcess tells")
    return serve(json.loads(parser.parse_args(argv).serve))


def main() -> int:
    """Entry point of `python -m drivers.gpio.process`."""
    return guarded(run)


if __name__ == "__main__":
    sys.exit(main())
