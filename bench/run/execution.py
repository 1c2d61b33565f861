"""One run: resolve, start both processes, watch them, collect the logs, judge."""

from __future__ import annotations

import asyncio
import contextlib
import resource
import signal
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import uvloop

from bench.live.feed import watch_status
from bench.live.sockets import point_to, socket_directory
from bench.run.directory import RunFiles
from bench.run.failure import error_of
from bench.run.processes import Child, Status, supervise
from bench.run.progress import View
from bench.run.resolve import resolve
from drivers.recorder.output import wait_finished
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.errors import HilError, RunError
from hil.files import Output

_LOG_TIMEOUT_S, _INTERRUPT_TIMEOUT_S = 30.0, 1.0
_HANDLES = 40


class Ended(NamedTuple):
    """How the processes of a run ended; `error` is None when all did as they should."""

    processes: dict[str, dict[str, Any]]
    wall_s: float
    started: str
    error: HilError | None = None
    exit_code: int = 0


@contextlib.contextmanager
def resolved(scenario: Scenario) -> Iterator[Resolved]:
    """Yield the scenario resolved for one run, whose processes meet on sockets of their own.

    Raises: ConfigError when it cannot be run as it is
    """
    with socket_directory() as sockets:
        yield resolve(scenario, sockets)


def execute(scenario: Resolved, files: RunFiles, view: View) -> Ended:
    """Run a scenario and tell how its processes ended."""
    _check_handles()
    write_scenario(scenario, files)
    point_to(files.directory, scenario.link.zenoh.plant_endpoint)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.get_loop()  # where it cannot be made, nothing has begun
        return runner.run(_run(scenario, files, view))


def write_scenario(scenario: Resolved, files: RunFiles) -> None:
    """Write what both processes, and who looks on, read the run from."""
    Output("--out", files.scenario, force=True).write(scenario.model_dump_json(indent=1))


def _check_handles() -> None:
    """Raise RunError when there are too few file handles to begin with."""
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed < _HANDLES <= most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    elif allowed < _HANDLES:
        raise RunError(f"{allowed} file handles are allowed, a run needs {_HANDLES}: ulimit -n")


async def _run(scenario: Resolved, files: RunFiles, view: View) -> Ended:
    """Start the processes, watch them to their end, and wait for their logs."""
    interrupt = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
            loop.add_signal_handler(number, interrupt.set)
    started = time.strftime("%Y-%m-%dT%H:%M:%S%z")
    start_s = time.monotonic()
    children: list[Child] = []

    def on_status(status: Status) -> None:
        view.update(status)
        for child in children:
            if child.name in {status.get("process"), "loop"}:
                child.witness.look(float(status.get("t_s") or 0.0))

    async with watch_status(scenario, on_status):
        await _start(children, scenario, files, on_status)
        end = await supervise(children, interrupt)
    wall_s = time.monotonic() - start_s
    await _collect(children, files, _INTERRUPT_TIMEOUT_S if end.interrupted else _LOG_TIMEOUT_S)
    processes = {child.name: _facts(child) for child in children}
    error = error_of(end, children, files)
    return Ended(processes, wall_s, started, error, error.exit_code if error else 0)


async def _start(
    children: list[Child], scenario: Resolved, files: RunFiles, on_status: Callable[[Status], None]
) -> None:
    """Start both processes, or the one that holds both when the link is memory."""
    config = ["--config", str(files.scenario)]
    plant, controller = str(files.plant_log), str(files.controller_log)
    if scenario.link.kind == "memory":
        logs = ["--plant-log", plant, "--controller-log", controller]
        module = "bench.run.single_process"
        children.append(await Child.start("loop", module, config + logs, on_status))
        return
    for name, log in (("plant", plant), ("controller", controller)):
        arguments = [*config, "--log", log]
        children.append(await Child.start(name, f"{name}.main", arguments, on_status))


async def _collect(children: list[Child], files: RunFiles, timeout_s: float) -> None:
    """Wait for the recorders, which outlive their processes, and keep what was said.

    One that has not finished within the time, which is for all of them, goes on by itself.
    """
    logs = [log for log in (files.plant_log, files.controller_log) if log.exists()]
    waits = [asyncio.to_thread(wait_finished, log, timeout_s) for log in logs]
    drains = [child.drain(timeout_s) for child in children]
    await asyncio.gather(*waits, *drains, return_exceptions=True)
    for child in children:
        if child.errors:
            Output("--out", files.errors_of(child.name), force=True).write(child.errors)


def _facts(child: Child) -> dict[str, Any]:
    held = {"held": child.witness.held} if child.witness.held else {}
    return {"pid": child.pid, "exit_code": child.exit_code, **child.result, **held}
