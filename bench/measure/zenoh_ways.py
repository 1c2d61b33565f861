"""Ways to wait for a message over Zenoh, side by side: which of them the link's own is, and why.

python -m bench.measure.zenoh_ways [--rate HZ] [--rounds N]

64 bytes there and back between two processes, once a period, by the library alone. The ways differ
in the endpoint, in the transport, in how many threads the library has, in who has the priority, and
in whether the receiver blocks or polls and gives its core away in between.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

PAYLOAD: Final = bytes(64)
PRIORITY: Final = 50
_PATIENCE_S: Final = 30.0
_ONE_EACH: Final = "({})".format(
    ", ".join(f"{kind}: (worker_threads: 1)" for kind in ("rx", "tx", "app", "net", "acc"))
)


class Way(NamedTuple):
    """One way; `priority` is whose it is: nobody's, the loop's alone, or its library's too."""

    name: str
    polls: bool = True
    priority: str = "all"
    tcp: bool = False
    low_latency: bool = False
    one_worker: bool = False


WAYS: Final = (
    Way("as the link does: polled, threads share its priority"),
    Way("blocking receive", polls=False),
    Way("blocking receive, priority of the loop alone", polls=False, priority="loop"),
    Way("blocking receive, no priority", polls=False, priority="none"),
    Way("over TCP on loopback", tcp=True),
    Way("low-latency transport (writes from the loop's thread)", low_latency=True),
    Way("one worker thread for each of the library's parts", one_worker=True),
)


def main() -> int:
    """Take each way in turn, and print a table."""
    parser = argparse.ArgumentParser(prog="zenoh_ways")
    parser.add_argument("--rate", type=int, default=5000)
    parser.add_argument("--rounds", type=int, default=10_000)
    parser.add_argument("--end", nargs=2, metavar=("ROLE", "WAY"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.end is not None:
        _end(given.end[0], WAYS[int(given.end[1])], given.rate, given.rounds)
        return 0
    print("| way | p50 [µs] | p99 [µs] | within a period | processor a round [µs] |")
    print("|---|---|---|---|---|")
    for number, way in enumerate(WAYS):
        print(f"| {way.name} | {_measured(number, way, given.rate, given.rounds)} |", flush=True)
    return 0


def _measured(number: int, way: Way, rate_hz: int, rounds: int) -> str:
    with tempfile.TemporaryDirectory(prefix="hil-ways-") as place:
        environment = {**os.environ, **({"ZENOH_RUNTIME": _ONE_EACH} if way.one_worker else {})}
        ends = [
            subprocess.Popen(
                [sys.executable, "-P", "-m", __spec__.name, "--end", role, str(number), "--rate",
                 str(rate_hz), "--rounds", str(rounds)],
                env={**environment, "PYTHONPATH": str(Path.cwd()), "HIL_WAYS": place},
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            )
            for role in ("answers", "asks")
        ]  # fmt: skip
        try:
            told, _ = ends[1].communicate(timeout=_PATIENCE_S + rounds / rate_hz)
        except subprocess.TimeoutExpired:
            told = ""
        for end in ends:
            end.kill()
            end.wait()
    return told.strip() or "does not end | | |"


def _end(role: str, way: Way, rate_hz: int, rounds: int) -> None:
    import zenoh

    session = _opened(role, way)
    own, other = ("a", "b") if role == "asks" else ("b", "a")
    subscriber = session.declare_subscriber(f"ways/{other}", zenoh.handlers.RingChannel(64))
    publisher = session.declare_publisher(
        f"ways/{own}", congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME, express=True,
    )  # fmt: skip
    while not publisher.matching_status.matching:
        time.sleep(0.01)
    handler = subscriber.handler  # which lives no longer than its subscriber
    receive = _polled(handler.try_recv) if way.polls else handler.recv
    if role == "answers":
        for _ in range(rounds):
            publisher.put(receive().payload.to_bytes())
        return
    time.sleep(0.3)
    trips_ns, cpu_s = _asked(publisher.put, receive, rate_hz, rounds)
    trips_ns.sort()
    within = sum(trip < 1e9 / rate_hz for trip in trips_ns) / rounds
    p50_us, p99_us = (trips_ns[int(share * rounds)] / 1e3 for share in (0.5, 0.99))
    print(f"{p50_us:.0f} | {p99_us:.0f} | {within:.2%} | {cpu_s / rounds * 1e6:.0f}", flush=True)


def _asked(
    put: Callable[[bytes], object], receive: Callable[[], object], rate_hz: int, rounds: int
) -> tuple[list[int], float]:
    """Round trips [ns], and the processor time of this end [s]."""
    trips_ns: list[int] = []
    due_s, begin_s = time.perf_counter(), time.process_time()
    for _ in range(rounds):
        due_s += 1.0 / rate_hz
        early_s = due_s - time.perf_counter()
        if early_s > 0.0:
            time.sleep(early_s)
        else:
            due_s = time.perf_counter()
        sent_ns = time.perf_counter_ns()
        put(PAYLOAD)
        receive()
        trips_ns.append(time.perf_counter_ns() - sent_ns)
    return trips_ns, time.process_time() - begin_s


def _polled(take: Callable[[], Any]) -> Callable[[], Any]:
    """Look, and give the core to threads of the same priority in between."""
    give_way = os.sched_yield

    def receive() -> Any:  # noqa: ANN401
        while (sample := take()) is None:
            give_way()
        return sample

    return receive


def _opened(role: str, way: Way) -> Any:  # noqa: ANN401
    """A session whose threads have what priority they are to have."""
    import zenoh

    ends = (
        ["tcp/127.0.0.1:17447", "tcp/127.0.0.1:17448"] if way.tcp
        else [f"unixsock-stream/{Path(os.environ['HIL_WAYS']) / end}" for end in ("a", "b")]
    )  # fmt: skip
    own, other = ends if role == "asks" else reversed(ends)
    tree = {
        "mode": "peer",
        "listen": {"endpoints": [own]},
        "connect": {"endpoints": [other], "timeout_ms": -1, "exit_on_failure": False},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "unicast": {"lowlatency": way.low_latency, "qos": {"enabled": not way.low_latency}}
        },
    }
    _prioritise(way.priority == "all")
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(tree)))
    _prioritise(way.priority != "none")
    return session


def _prioritise(wanted: bool) -> None:
    if wanted:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


if __name__ == "__main__":
    sys.exit(main())
