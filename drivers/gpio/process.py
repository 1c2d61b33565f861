"""The process that drives the TTL lines: fed with the frames that are sent, edges placed by time.

It holds the lines low before the first frame, in the safe state, after silence, when the loop's
process is gone, and when it ends. After its kill drivers/gpio/low.py does.
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
from drivers.gpio.schedule import EdgeSchedule, PlantClock, unwrapped_ns
from drivers.recorder.ring import Consumer
from drivers.system.process import guarded
from drivers.system.realtime import prepare
from hil.config.outputs import OutputsConfig
from hil.config.process import RealtimeConfig
from hil.wire.codec import Decoder
from hil.wire.messages import OPERATING_MODES, ControllerTick, Pulse

HEAD: Final = struct.Struct("<qH")  # arrival of the sample that was answered [ns], bytes of frames
_READ_BYTES: Final = 1 << 16
_SAFE: Final = next(number for number, name in OPERATING_MODES.items() if name == "safe")
_NAP_NS: Final = 250_000


class EdgeDriver:
    """Frames to edges on lines; knows nothing of processes."""

    def __init__(self, lines: Lines, config: OutputsConfig, period_ns: int) -> None:
        self._lines = lines
        self._schedule = EdgeSchedule(lines.channels, config.late_us * 1000)
        self._clock = PlantClock(period_ns, config.phase_us * 1000)
        self._decoder = Decoder("controller")
        self._silence_ns = round(config.silence_s * 1e9)
        self._heard_ns: int | None = None

    @property
    def late(self) -> int:
        """Openings that were known too late."""
        return self._schedule.late

    def take(self, arrival_ns: int, batch: bytes, now_ns: int) -> None:
        """Take the frames of one answer; the mode `safe` ends everything at once."""
        tick, mode, pulses = -1, _SAFE, []
        for message in self._decoder.decode(batch):
            kind = type(message)
            if kind is ControllerTick:
                tick, mode = message.tick, message.mode
            elif kind is Pulse:
                pulses.append(message)
        if tick < 0:
            return
        self._heard_ns = now_ns
        self._clock.arrived(tick, arrival_ns)
        plant_ns = self._clock.plant_ns(now_ns)
        if mode == _SAFE:
            self.rest(plant_ns)
            return
        for channel, open_us, duration_us in pulses:
            open_ns = unwrapped_ns(open_us, plant_ns)
            self._schedule.order(channel, open_ns, open_ns + duration_us * 1000, plant_ns)

    def act(self, now_ns: int) -> int:
        """Place the edges that are due; return when to look again on the monotonic clock [ns]."""
        if self._heard_ns is None:
            return now_ns + _NAP_NS
        plant_ns = self._clock.plant_ns(now_ns)
        if now_ns - self._heard_ns > self._silence_ns:
            self._heard_ns = None
            self.rest(plant_ns)
            return now_ns + _NAP_NS
        for edge in self._schedule.due(plant_ns):
            self._lines.set(edge.channel, edge.high)
        return min(self._clock.monotonic_ns(self._schedule.next_ns()), now_ns + _NAP_NS)

    def rest(self, plant_ns: int = 0) -> None:
        """Forget what was ordered and let all lines be low."""
        self._schedule.clear(plant_ns)
        self._lines.all_low()


def split(data: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Return (arrival, frames) of the whole records in the ring's bytes, and the rest."""
    records, at = [], 0
    while at + HEAD.size <= len(data):
        arrival_ns, size = HEAD.unpack_from(data, at)
        end = at + HEAD.size + size
        if end > len(data):
            break
        records.append((arrival_ns, data[at + HEAD.size : end]))
        at = end
    return records, data[at:]


def drive(driver: EdgeDriver, ring: Consumer, spin_ns: int, goes_on: Callable[[], bool]) -> None:
    """Read, act and sleep until told to end."""
    rest = b""
    now = time.monotonic_ns
    while goes_on():
        if data := ring.read(_READ_BYTES):
            records, rest = split(rest + data)
            for arrival_ns, batch in records:
                driver.take(arrival_ns, batch, now())
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
        driver = EdgeDriver(lines, config, int(str(told["period_ns"])))
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
