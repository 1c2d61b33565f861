"""The plant process: its ports opened, its loop run to the end."""

from __future__ import annotations

import sys
from pathlib import Path

from drivers.links import Connection, open_link
from drivers.system.clock import SystemClock
from drivers.system.effort import Effort
from drivers.system.log import open_recorder
from drivers.system.process import (
    Stop,
    brake,
    guarded,
    last_words,
    note_granted,
    noting,
    read_arguments,
    rehearse,
)
from drivers.system.realtime import pin, prepare
from drivers.system.service import Heart, Service
from hil.config.resolved import Resolved
from hil.config.terms import terms_of
from hil.ports import Recorder
from hil.values import NEVER
from plant.build import make_loop, make_pacer
from plant.loop import PlantLoop
from plant.status import describe, facts, is_safe, raise_if_lost


def run(scenario: Resolved, log: Path | None, service: Service | None = None) -> int:
    """Run the plant to its end; as a service, until it is asked to end.

    Raises: RunError when the controller was lost or the log is cut, ConfigError, LinkError
    """
    stop = Stop()
    stop.listen()
    recorder = open_recorder(log, scenario, "plant", live=True)
    recorder.watch(scenario.log.recorder_lost, stop.end)
    # Before the link opens: its threads inherit the priority; the recorder must not.
    granted = prepare(scenario.realtime, lockstep=scenario.loop.clock == "lockstep")
    connection = open_link("plant", scenario.link, scenario.loop, terms_of(scenario))
    try:
        clock = SystemClock(scenario.realtime.spin_s, scenario.loop.period_ns)
        reporting = noting(recorder, connection.link)
        loop = make_loop(scenario, connection, reporting, make_pacer(scenario, clock))
        granted |= pin(scenario.realtime)
        note_granted(recorder, scenario, granted)
        rehearse(loop.remember(), loop.params.config)
        wait_for_controller(scenario, connection, stop, service)
        heart = Heart() if service is None else service.heart
        ticks = scenario.ticks if service is None else NEVER
        effort = Effort(recorder)
        tick = turn_until(loop, ticks, stop, heart)
        if stop.cause:
            tick = to_safe_state(loop, recorder, tick, stop)
        told = {**facts(loop, connection, tick), **stop.facts()}
        last_words({**told, "granted": granted, **effort.told()})
    finally:
        if service is not None and stop.requested:
            service.ends()
        connection.close()
        recorder.close()
    stop.raise_if_caused()
    if service is None:
        raise_if_lost(loop)
    recorder.raise_if_cut()
    return 0


def wait_for_controller(
    scenario: Resolved, connection: Connection, stop: Stop, service: Service | None
) -> None:
    """Return when the controller takes part.

    Raises: LinkError when it does not within the time
    """
    timeout_s = scenario.loop.peer_timeout_s
    if service is None:
        stop.wait_for_peer(connection.link, timeout_s)
    else:
        service.wait_for_peer(connection.link, "controller", timeout_s, stop)


def turn_until(loop: PlantLoop, ticks: int, stop: Stop, heart: Heart) -> int:
    """Run the loop for so many ticks, or until it is asked to end; returns the tick reached."""
    tick = 0
    heart.start(tick)
    while tick < ticks and not stop.requested:
        tick = loop.turn(tick)
        if tick >= heart.next_tick:
            heart.beat(tick, loop.answered > 0, lambda: describe(loop))
    return tick


def to_safe_state(loop: PlantLoop, recorder: Recorder, tick: int, stop: Stop) -> int:
    """Go on for as long as the controller brakes and then is missed; returns the tick reached."""

    def turn() -> bool:
        nonlocal tick
        tick = loop.turn(tick)
        return is_safe(loop)

    brake(stop, recorder, tick, tick * loop.params.period_ns, turn)
    return tick


def main() -> int:
    """Entry point of `python -m plant.main`."""
    return guarded(lambda: run(*read_arguments("plant")))


if __name__ == "__main__":
    sys.exit(main())
