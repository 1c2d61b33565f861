"""The plant process: configuration, ports, loop."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from drivers.clock import SystemClock
from drivers.effort import Effort
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
from drivers.service import Heart, Service
from hil import snapshot
from hil.config.resolved import Resolved
from hil.config.scenario import OperatorEvent
from hil.errors import RunError
from hil.pacing import NEVER, LockstepPacer, Pacer, RealTimePacer
from hil.ports import Recorder
from hil.realtime import pin, prepare
from plant.initial import initial_state
from plant.loop import PlantLoop
from plant.params import PlantParams, plant_params


def make_params(scenario: Resolved) -> PlantParams:
    """The plant's part of a scenario."""
    events = {
        name: event
        for name, event in scenario.events.items()
        if not isinstance(event, OperatorEvent)
    }
    return plant_params(scenario.plant, scenario.loop.period_ns, scenario.run.seed, events)


def make_pacer(scenario: Resolved) -> Pacer:
    """Real time: deadlines and the newest answer, if any. Lockstep: the answer must come."""
    period_ns = scenario.loop.period_ns
    if scenario.loop.clock == "realtime":
        return RealTimePacer(SystemClock(scenario.realtime.spin_s, period_ns), period_ns)
    return LockstepPacer(period_ns, round(scenario.loop.peer_timeout_s * 1e9))


def make_loop(
    scenario: Resolved, connection: Connection, recorder: Recorder, pacer: Pacer | None = None
) -> PlantLoop:
    """Put parameters, initial state and ports together.

    Raises: ConfigError when the run cannot begin as it is asked to
    """
    params = make_params(scenario)
    settled = scenario.begins == "settled"
    state, events = initial_state(
        params,
        scenario.controller.preset.fuel_kg if settled else None,
        scenario.controller.supervisory.load_coefficient_n_s_m,
    )
    return PlantLoop(
        params, state, events, link=connection.link, pacer=pacer or make_pacer(scenario),
        recorder=noting(recorder, connection.link), status=connection.status,
        status_every=scenario.loop.status_every,
        snapshot_every=scenario.loop.snapshot_every, commands=connection.commands,
    )  # fmt: skip


def run(scenario: Resolved, log: Path | None, service: Service | None = None) -> int:
    """Run the plant to its end; as a service, until it is asked to end.

    Raises: RunError when the controller was lost, ConfigError, LinkError
    """
    stop = Stop()
    stop.listen()
    recorder = open_recorder(log, scenario, "plant")
    # Before the link opens: its threads inherit the priority; the recorder must not.
    granted = prepare(scenario.realtime, lockstep=scenario.loop.clock == "lockstep")
    connection = open_link("plant", scenario.link, scenario.loop)
    try:
        loop = make_loop(scenario, connection, recorder)
        granted |= pin(scenario.realtime)
        note_granted(recorder, scenario, granted)
        wait_for_controller(scenario, connection, stop, service)
        heart = Heart() if service is None else service.heart
        ticks = scenario.ticks if service is None else NEVER
        snapshot.dumps(loop.remember())  # the first one works out how, which takes milliseconds
        effort = Effort(recorder)
        tick = turn_until(loop, ticks, stop, heart)
        last_words({**facts(loop, connection, tick), "granted": granted, **effort.told()})
    finally:
        if service is not None and stop.requested:
            service.ends()
        connection.close()
        recorder.close()
    if service is None:
        raise_if_lost(loop)
    return 0


def wait_for_controller(
    scenario: Resolved, connection: Connection, stop: Stop, service: Service | None
) -> None:
    """Return when the controller takes part.

    Raises: LinkError when it does not within the time
    """
    timeout_s = scenario.loop.peer_timeout_s
    if service is None:
        connection.link.wait_for_peer(timeout_s)
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


def describe(loop: PlantLoop) -> str:
    """How the plant is, in one line."""
    state = loop.state
    how = "safe state" if state.stale >= loop.params.stale_ticks else "controlled"
    return f"{how}, tick {state.tick}, TDC {abs(state.dead_centre.x_m) * 1e3:.2f} mm"


def raise_if_lost(loop: PlantLoop) -> None:
    """A run that ended without its controller did not end well.

    Raises: RunError
    """
    if loop.state.stale >= loop.params.stale_ticks:
        if not loop.answered:
            raise RunError("controller never answered")
        raise RunError(f"controller lost: no valid command in the last {loop.state.stale} ticks")


def facts(loop: PlantLoop, connection: Connection, ticks: int) -> dict[str, Any]:
    """How it went, for the summary."""
    return {
        "ticks": ticks,
        "answered": loop.answered,
        "contacts": loop.state.contacts,
        "reception": loop.decoder.counts()._asdict(),
        "link": dict(connection.link.counters()),
    }


def main() -> int:
    """Entry point of `python -m plant.main`."""
    return guarded(lambda: run(*read_arguments("plant")))


if __name__ == "__main__":
    sys.exit(main())
