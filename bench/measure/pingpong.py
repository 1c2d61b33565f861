"""One process of a latency measurement: a source that asks at a fixed rate, or who answers it.

python -m bench.measure.pingpong ROLE --config FILE [--out FILE]

bare:  64 bytes there and back by the library alone, blocking reads for Zenoh, polling for shm
link:  the same through this project's link, paced by its clock, answered by an echo
loop:  a real plant asks, and waits for the answer of a real controller process in its turn
"""

from __future__ import annotations

import argparse
import json
import struct
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from drivers.links import open_link
from drivers.system.clock import SystemClock
from drivers.system.log import open_recorder
from drivers.system.process import Stop, guarded
from drivers.system.realtime import pin, prepare
from hil.config.resolved import Resolved, read_resolved
from hil.pacing import Pacer, RealTimePacer, Slot
from hil.ports import Link

PAYLOAD: Final = bytes(64)
_HEAD: Final = struct.Struct("<HQ")
WAIT_SHARE: Final = 0.8
"""Of a period is how long a source waits for its answer; what comes later is none."""

_JOIN_S: Final = 10.0
_SILENCE_S: Final = 1.0
_LAST_S: Final = 0.05  # for the last message to leave before the session closes


class Times:
    """What a source measured [ns]: its lateness tick by tick, and each round trip."""

    def __init__(self) -> None:
        self.late_ns: list[int] = []
        self.trip_ns: list[int] = []
        self.missed = 0
        self.unanswered = 0

    def save(self, path: Path, granted: Mapping[str, str], seconds: float) -> None:
        """Write it all as JSON; the first tenth is warm-up and left out."""
        skip = min(len(self.late_ns) // 10, 500)
        facts = {
            "late_ns": self.late_ns[skip:], "trip_ns": self.trip_ns[skip:], "missed": self.missed,
            "unanswered": self.unanswered, "granted": granted, "seconds": seconds,
            "processor_s": time.process_time(),
        }  # fmt: skip
        path.write_text(json.dumps(facts), encoding="utf-8")


class TimedPacer(Pacer):
    """A pacer in real time that notes how late each slot began."""

    def __init__(self, scenario: Resolved, times: Times) -> None:
        period_ns = scenario.loop.period_ns
        super().__init__(period_ns)
        self._pacer = RealTimePacer(SystemClock(scenario.realtime.spin_s, period_ns), period_ns)
        self._times = times

    def start(self, tick: int = 0) -> None:
        """Let the slot of this tick begin now."""
        self._pacer.start(tick)

    def now_ns(self) -> int:
        """Return the time since tick 0 was due [ns]."""
        return self._pacer.now_ns()

    def wait(self, tick: int) -> Slot:
        """Return the slot of the tick."""
        slot = self._pacer.wait(tick)
        self._times.late_ns.append(slot.woke_ns - slot.scheduled_ns)
        self._times.missed += slot.missed
        return slot


def tick_of(batch: bytes) -> int:
    """Return the tick in the head of a batch, which stands in the same bits in both directions."""
    return int.from_bytes(batch[2:10], "little") >> 12 & 0xFFFFFFFF


class TimedLink(Link):
    """A link whose `send` also waits for the answer, and keeps what came for `receive`.

    Only the answer to this very tick ends the wait: one to an earlier tick that comes late must
    not pass for it. A trip that was given up counts with the time it had taken by then.
    """

    def __init__(self, link: Link, period_ns: int, times: Times) -> None:
        self._link = link
        self._wait_ns = round(WAIT_SHARE * period_ns)
        self._times = times
        self._kept: deque[bytes] = deque()

    def send(self, batch: bytes, /) -> None:
        """Send, and time the answer."""
        tick = tick_of(batch)
        now_ns = start_ns = time.monotonic_ns()
        end_ns = start_ns + self._wait_ns
        self._link.send(batch)
        while now_ns < end_ns:
            answer = self._link.wait(end_ns - now_ns)
            now_ns = time.monotonic_ns()
            if answer is not None:
                self._kept.append(answer)
                if tick_of(answer) == tick:
                    break
        else:
            self._times.unanswered += 1
        self._times.trip_ns.append(now_ns - start_ns)

    def receive(self) -> bytes | None:
        """Return the oldest answer that came within the turn before, or since."""
        return self._kept.popleft() if self._kept else self._link.receive()

    def wait(self, timeout_ns: int, /) -> bytes | None:
        """Wait as the link does."""
        return self._link.wait(timeout_ns)

    def peer_alive(self) -> bool:
        """Ask the link."""
        return self._link.peer_alive()

    def wait_for_peer(self, timeout_s: float) -> None:
        """Ask the link."""
        self._link.wait_for_peer(timeout_s)

    def counters(self) -> Mapping[str, int]:
        """Ask the link."""
        return self._link.counters()

    def close(self) -> None:
        """Close the link."""
        self._link.close()


def link_source(scenario: Resolved, out: Path) -> int:
    """Ask through the link, once a period."""
    granted = prepare(scenario.realtime)
    connection = open_link("plant", scenario.link, scenario.loop)
    times = Times()
    try:
        connection.link.wait_for_peer(_JOIN_S)
        link = TimedLink(connection.link, scenario.loop.period_ns, times)
        pacer, tick, ticks = TimedPacer(scenario, times), 0, _ticks(scenario)
        while tick < ticks:
            tick = pacer.wait(tick).tick + 1
            while link.receive() is not None:
                pass
            link.send(_HEAD.pack(0, tick << 12) + PAYLOAD[_HEAD.size :])
    finally:
        connection.close()
    times.save(out, granted | pin(scenario.realtime), scenario.run.duration_s)
    return 0


def link_echo(scenario: Resolved, _out: Path) -> int:
    """Send back what comes through the link, until nothing does."""
    prepare(scenario.realtime)
    connection = open_link("controller", scenario.link, scenario.loop)
    try:
        connection.link.wait_for_peer(_JOIN_S)
        link, stop, silent_ns = connection.link, Stop(), 0
        stop.listen()
        patience_ns = round(1.5 * scenario.loop.period_ns)
        while not stop.requested and silent_ns < _SILENCE_S * 1e9:
            batch = link.wait(patience_ns)
            silent_ns = 0 if batch is not None else silent_ns + patience_ns
            if batch is not None:
                link.send(batch)
    finally:
        connection.close()
    return 0


def loop_source(scenario: Resolved, out: Path) -> int:
    """Run a real plant; its link waits for each answer."""
    from plant.build import make_loop

    recorder = open_recorder(out.with_suffix(".mcap"), scenario, "plant")
    granted = prepare(scenario.realtime)
    connection = open_link("plant", scenario.link, scenario.loop)
    times = Times()
    try:
        link = TimedLink(connection.link, scenario.loop.period_ns, times)
        pacer = TimedPacer(scenario, times)
        loop = make_loop(scenario, connection._replace(link=link), recorder, pacer)
        connection.link.wait_for_peer(_JOIN_S)
        tick, ticks = 0, _ticks(scenario)
        while tick < ticks:
            tick = loop.turn(tick)
    finally:
        connection.close()
        recorder.close()
    times.save(out, granted | pin(scenario.realtime), scenario.run.duration_s)
    return 0


def bare_source(scenario: Resolved, out: Path) -> int:
    """Ask by the library alone, once a period."""
    from bench.measure import bare

    granted = prepare(scenario.realtime)
    times, period_ns = Times(), scenario.loop.period_ns
    with bare.opened(scenario, "plant") as (send, take):
        bare.join(send, take, _JOIN_S)
        due_ns = time.monotonic_ns()
        for _ in range(_ticks(scenario)):
            due_ns = max(due_ns + period_ns, time.monotonic_ns())
            time.sleep(max(due_ns - time.monotonic_ns(), 0) * 1e-9)
            start_ns = time.monotonic_ns()
            times.late_ns.append(start_ns - due_ns)
            send(PAYLOAD)
            take(None)
            times.trip_ns.append(time.monotonic_ns() - start_ns)
        send(bare.END)
        time.sleep(_LAST_S)
    times.save(out, granted, scenario.run.duration_s)
    return 0


def bare_echo(scenario: Resolved, _out: Path) -> int:
    """Send back what comes, by the library alone."""
    from bench.measure import bare

    prepare(scenario.realtime)
    with bare.opened(scenario, "controller") as (send, take):
        while (batch := take(None)) is not None and batch != bare.END:
            send(batch)
    return 0


def _ticks(scenario: Resolved) -> int:
    return round(scenario.run.duration_s * scenario.loop.rate_hz)


ROLES: Final[dict[str, Callable[[Resolved, Path], int]]] = {
    "bare-source": bare_source, "bare-echo": bare_echo, "link-source": link_source,
    "link-echo": link_echo, "loop-source": loop_source,
}  # fmt: skip


def run(argv: list[str] | None = None) -> int:
    """Read the arguments and play the role."""
    parser = argparse.ArgumentParser(prog="pingpong")
    parser.add_argument("role", choices=sorted(ROLES))
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=Path("times.json"))
    given = parser.parse_args(argv)
    return ROLES[given.role](read_resolved(given.config), given.out)


def main() -> int:
    """Entry point of `python -m bench.measure.pingpong`."""
    return guarded(run)


if __name__ == "__main__":
    sys.exit(main())
