"""The controller process: configuration, ports, loop."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from controller.commands import OperatorCommand
from controller.duty import Duty
from controller.loop import ControllerLoop
from controller.state import initial_state, make_params
from drivers.clock import SystemClock
from drivers.effort import Effort
from drivers.gpio import open_outputs, with_outputs
from drivers.links import Connection, open_link
from drivers.process import (
    Stop,
    guarded,
    last_words,
    note_granted,
    noting,
    open_recorder,
    read_arguments,
)
from drivers.service import Service
from hil import snapshot
from hil.config.resolved import Resolved
from hil.config.scenario import OperatorEvent
from hil.errors import RunError
from hil.exchange import await_batch
from hil.pacing import NEVER, LockstepPacer, Pacer, RealTimePacer
from hil.ports import Recorder
from hil.realtime import pin, prepare

SAMPLE_PATIENCE_PERIODS = 1.5
"""How long a sample may be late before its tick is stepped without it."""

FIRST_SLICE_NS = 200_000_000
ANEW_NS = 250_000_000
"""A stall lets old samples come in a burst; when none but old ones come for so long, their plant is
another one than before."""


def make_pacer(scenario: Resolved) -> Pacer:
    """The plant paces: in real time patience is 1.5 periods, in lockstep the peer time-out."""
    period_ns = scenario.loop.period_ns
    if scenario.loop.clock == "realtime":
        clock = SystemClock(scenario.realtime.spin_s)
        return RealTimePacer(clock, period_ns, round(SAMPLE_PATIENCE_PERIODS * period_ns))
    return LockstepPacer(period_ns, round(scenario.loop.peer_timeout_s * 1e9))


def schedule_of(scenario: Resolved) -> dict[int, OperatorCommand]:
    """The scenario's own operator commands by tick.

    Two in one tick follow each other in the next free one.
    """
    schedule: dict[int, OperatorCommand] = {}
    for event in scenario.events.values():
        if isinstance(event, OperatorEvent):
            tick = round(event.at_s * scenario.loop.rate_hz)
            while tick in schedule:
                tick += 1
            schedule[tick] = OperatorCommand(
                event.kind, event.tdc_ref_m, event.target_power_w, law=event.law
            )
    return schedule


def make_loop(
    scenario: Resolved, connection: Connection, pacer: Pacer, recorder: Recorder
) -> ControllerLoop:
    """Put parameters, initial state and ports together."""
    params = make_params(scenario.controller, scenario.plant.prototype, scenario.loop.period_ns)
    return ControllerLoop(
        params, initial_state(params), link=connection.link, pacer=pacer,
        recorder=noting(recorder, connection.link), status=connection.status,
        commands=connection.commands, schedule=schedule_of(scenario),
        status_every=scenario.loop.status_every,
        peer_timeout_s=scenario.loop.peer_timeout_s,
        snapshot_every=scenario.loop.snapshot_every,
    )  # fmt: skip


def run(scenario: Resolved, log: Path | None, service: Service | None = None) -> int:
    """Run the controller to its end; as a service, until it is asked to end.

    Raises: RunError when the plant was lost, ConfigError, LinkError
    """
    stop = Stop()
    stop.listen()
    recorder = open_recorder(log, scenario, "controller")
    outputs = open_outputs(scenario)
    # Before the link opens: its threads inherit the priority; the recorder must not.
    granted = prepare(scenario.realtime, lockstep=scenario.loop.clock == "lockstep")
    connection = with_outputs(open_link("controller", scenario.link, scenario.loop), outputs)
    duty = None
    if service is not None:
        duty = Duty(service.heart, service, connection.commands)
        connection = connection._replace(commands=duty.commands)
    effort = Effort(recorder)
    try:
        pacer = make_pacer(scenario)
        loop = make_loop(scenario, connection, pacer, recorder)
        granted |= pin(scenario.realtime)
        note_granted(recorder, scenario, granted)
        snapshot.dumps(loop.remember())  # the first one works out how, which takes milliseconds
        if service is not None:
            service.wait_for_peer(connection.link, "plant", scenario.loop.peer_timeout_s, stop)
            follow_in_real_time(loop, connection, pacer.patience_ns, NEVER, stop, duty)
        else:
            connection.link.wait_for_peer(scenario.loop.peer_timeout_s)
            effort = Effort(recorder)
            last_tick = scenario.ticks - 1
            drive = follow_in_real_time if scenario.loop.clock == "realtime" else follow_in_lockstep
            drive(loop, connection, pacer.patience_ns, last_tick, stop)
        last_words({**facts(loop, connection), "granted": granted, **effort.told()})
    finally:
        if service is not None and stop.requested:
            service.ends()
        connection.close()
        recorder.close()
    if service is None:
        raise_if_lost(loop)
    return 0


def follow_in_lockstep(
    loop: ControllerLoop, connection: Connection, patience_ns: int, last_tick: int, stop: Stop
) -> None:
    """Answer every sample; when the plant is gone, step without one until the safe state."""
    while loop.tick < last_tick and not stop.requested:
        batch = await_batch(connection.link, patience_ns)
        if batch is None:
            break
        loop.turn(batch)
    else:
        return
    for _ in range(loop.params.config.limits.stale_ticks):
        loop.turn(None)


def follow_in_real_time(
    loop: ControllerLoop,
    connection: Connection,
    patience_ns: int,
    last_tick: int,
    stop: Stop,
    duty: Duty | None = None,
) -> None:
    """Answer every sample, and a tick whose sample has not come after 1.5 periods without it.

    Raises: RunError when the plant never sends, or begins anew
    """
    link, period_ns = connection.link, loop.params.period_ns
    first = await_first(loop, connection, stop)
    if first is None:
        return
    loop.turn(first)
    if duty is not None:
        duty.begin(loop)
    wait_ns, old = patience_ns, OldSamples()
    while loop.tick < last_tick and not stop.requested:
        batch = link.wait(wait_ns)
        before = loop.tick
        loop.turn(batch)
        wait_ns = patience_ns if batch is not None else period_ns
        if old.go_on(0 <= before == loop.tick):
            raise RunError(f"plant began anew after tick {loop.tick}")
        if duty is not None and loop.tick >= duty.next_tick:
            duty.attend(loop)


class OldSamples:
    """How long nothing but samples of ticks that are over has come."""

    def __init__(self) -> None:
        self._since_ns = 0

    def go_on(self, is_old: bool) -> bool:
        """Take note of a turn; returns whether it has gone on for too long."""
        if not is_old:
            self._since_ns = 0
            return False
        now_ns = time.monotonic_ns()
        self._since_ns = self._since_ns or now_ns
        return now_ns - self._since_ns > ANEW_NS


def await_first(loop: ControllerLoop, connection: Connection, stop: Stop) -> bytes | None:
    """Return the first batch, None when asked to end before it.

    Raises: RunError when the plant never sends
    """
    left_ns = round(1e9 * loop.peer_timeout_s)
    while left_ns > 0 and not stop.requested:
        first = await_batch(connection.link, min(left_ns, FIRST_SLICE_NS))
        if first is not None:
            return first
        left_ns -= FIRST_SLICE_NS
    if stop.requested:
        return None
    raise RunError("plant sent no sample")


def raise_if_lost(loop: ControllerLoop) -> None:
    """A run that ended without its plant did not end well.

    Raises: RunError
    """
    stale = loop.state.stale
    if stale >= loop.params.config.limits.stale_ticks:
        raise RunError(f"plant lost: no valid sample in the last {stale} ticks")


def facts(loop: ControllerLoop, connection: Connection) -> dict[str, Any]:
    """How it went, for the summary."""
    return {
        "ticks": loop.tick + 1,
        "mode": loop.state.mode.name.lower(),
        "reception": loop.decoder.counts()._asdict(),
        "doubted": {"out_of_step": loop.out_of_step, "implausible": loop.implausible},
        "link": dict(connection.link.counters()),
    }


def main() -> int:
    """Entry point of `python -m controller.main`."""
    return guarded(lambda: run(*read_arguments("controller")))


if __name__ == "__main__":
    sys.exit(main())
