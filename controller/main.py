"""The controller process: configuration, ports, loop."""

from __future__ import annotations

import sys
from pathlib import Path

from controller.build import make_loop, make_pacer
from controller.duty import Duty
from controller.follow import (
    facts,
    follow_in_lockstep,
    follow_in_real_time,
    raise_if_lost,
    step_alone,
)
from controller.loop import ControllerLoop
from drivers.gpio.link import open_outputs, with_outputs
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
from drivers.system.service import Service
from hil.config.resolved import Resolved
from hil.config.terms import terms_of
from hil.ports import Link, Recorder
from hil.values import NEVER


def run(scenario: Resolved, log: Path | None, service: Service | None = None) -> int:
    """Run the controller to its end; as a service, until it is asked to end.

    Raises: RunError when the plant was lost or the log is cut, ConfigError, LinkError
    """
    stop = Stop()
    stop.listen()
    recorder = open_recorder(log, scenario, "controller", live=True)
    recorder.watch(scenario.log.recorder_lost, stop.end)
    outputs = open_outputs(scenario)
    # Before the link opens: its threads inherit the priority; the recorder must not.
    granted = prepare(scenario.realtime, lockstep=scenario.loop.clock == "lockstep")
    link = open_link("controller", scenario.link, scenario.loop, terms_of(scenario))
    connection = with_outputs(link, outputs)
    duty = None
    if service is not None:
        duty = Duty(service.heart, service, connection.commands, scenario.safety.rearm)
        connection = connection._replace(commands=duty.commands)
    try:
        pacer = make_pacer(scenario, SystemClock(scenario.realtime.spin_s))
        loop = make_loop(scenario, connection, noting(recorder, connection.link), pacer)
        granted |= pin(scenario.realtime)
        note_granted(recorder, scenario, granted)
        rehearse(loop.remember(), loop.params.config)
        if service is None:
            stop.wait_for_peer(connection.link, scenario.loop.peer_timeout_s)
        else:
            service.wait_for_peer(connection.link, "plant", scenario.loop.peer_timeout_s, stop)
        effort = Effort(recorder)
        _follow(scenario, loop, connection, pacer.patience_ns, stop, duty)
        if stop.cause:
            to_safe_state(loop, recorder, connection.link, stop)
        told = {**facts(loop, connection.link), **stop.facts()}
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


def _follow(
    scenario: Resolved, loop: ControllerLoop, connection: Connection, patience_ns: int, stop: Stop,
    duty: Duty | None,
) -> None:  # fmt: skip
    """Follow the plant to the end of the run; as a service, for as long as it runs."""
    link, last_tick = connection.link, round(scenario.run.duration_s * scenario.loop.rate_hz) - 1
    if duty is not None:
        follow_in_real_time(loop, link, patience_ns, NEVER, stop, duty)
    elif scenario.loop.clock == "realtime":
        follow_in_real_time(loop, link, patience_ns, last_tick, stop)
    else:
        follow_in_lockstep(loop, link, patience_ns, last_tick, stop)


def to_safe_state(loop: ControllerLoop, recorder: Recorder, link: Link, stop: Stop) -> None:
    """Go on without the plant for as long as it takes to brake."""
    t_ns = (loop.tick + 1) * loop.params.period_ns
    brake(stop, recorder, loop.tick + 1, t_ns, lambda: step_alone(loop, link))


def main() -> int:
    """Entry point of `python -m controller.main`."""
    return guarded(lambda: run(*read_arguments("controller")))


if __name__ == "__main__":
    sys.exit(main())
