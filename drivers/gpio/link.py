"""TTL outputs as a loop sees them: a link that also shows what it sends to the lines' process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from typing import Any, Final

from drivers.gpio.process import HEAD
from drivers.links import Connection
from drivers.recorder import ring
from hil.config.ranges import stale_ticks
from hil.config.resolved import Resolved
from hil.errors import ConfigError, RunError
from hil.ports import Link

RING_BYTES: Final = 1 << 18
_LOOK_EVERY: Final = 64  # sends between two looks at the process; a look is a system call
_END_S: Final = 2.0


class OutputProcess:
    """The process that drives the lines; low before `start` returns.

    Raises: RunError when it does not come up, with what it said
    """

    def __init__(self, scenario: Resolved, command: tuple[str, ...] = ()) -> None:
        fd = ring.create(RING_BYTES)
        self._ring = ring.Producer(fd)
        period_ns = scenario.loop.period_ns
        told = {
            "outputs": scenario.outputs.model_dump(), "ring": fd, "parent": os.getpid(),
            "period_ns": period_ns, "stale_ticks": stale_ticks(scenario.plant.stale_s, period_ns),
            "rearm": scenario.safety.rearm,
        }  # fmt: skip
        words = command or (sys.executable, "-P", "-m", "drivers.gpio.process")
        self._process = subprocess.Popen(
            [*words, "--serve", json.dumps(told)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            pass_fds=(fd,), start_new_session=True,
        )  # fmt: skip
        os.close(fd)
        assert self._process.stdout is not None
        if not self._process.stdout.readline():
            _, errors = self._process.communicate()
            raise RunError(errors.strip() or "outputs: the process of the lines did not come up")

    def put(self, data: bytes) -> None:
        """Hand over; a ring that is full drops, and silence then sets the lines low."""
        self._ring.put(data)

    def check(self) -> None:
        """Look whether it is there.

        Raises: RunError when it is gone
        """
        if (code := self._process.poll()) is not None:
            raise RunError(f"outputs: the process of the lines ended with {code}")

    def close(self) -> None:
        """Let the lines be low and the process end; a second call does nothing."""
        self._ring.close()
        try:
            self._process.communicate(timeout=_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()


class OutputLink(Link):
    """A link of the controller that shows its frames to the process of the lines."""

    def __init__(self, link: Link, outputs: OutputProcess) -> None:
        self._link = link
        self._outputs = outputs
        self._arrived_ns = 0
        self._sent = 0

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Whatever else a link has, such as counts of its bus."""
        return getattr(self._link, name)

    def send(self, batch: bytes, /) -> None:
        """Send, then show the frames.

        Raises: LinkError as the link, RunError when the process of the lines is gone
        """
        self._link.send(batch)
        self._outputs.put(HEAD.pack(self._arrived_ns, time.monotonic_ns(), len(batch)) + batch)
        self._sent += 1
        if self._sent % _LOOK_EVERY == 0:
            self._outputs.check()

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None."""
        return self._noted(self._link.receive())

    def wait(self, timeout_ns: int, /) -> bytes | None:
        """Like `receive`, but wait for at most this long [ns]."""
        return self._noted(self._link.wait(timeout_ns))

    def _noted(self, batch: bytes | None) -> bytes | None:
        """Note when a sample came; of a tick that is answered without one there is no arrival."""
        self._arrived_ns = 0 if batch is None else time.monotonic_ns()
        return batch

    def peer_alive(self) -> bool:
        """Whether the peer takes part by now."""
        return self._link.peer_alive()

    def wait_for_peer(self, timeout_s: float) -> None:
        """Return when the peer takes part.

        Raises: LinkError when it does not within the time
        """
        self._link.wait_for_peer(timeout_s)

    def reports(self) -> bool:
        """Whether the link's bus reports errors."""
        return self._link.reports()

    def notices(self) -> list[tuple[str, str]]:
        """Return what the link's bus reported."""
        return self._link.notices()

    def counters(self) -> Mapping[str, int]:
        """Return what the link counted."""
        return self._link.counters()

    def close(self) -> None:
        """Let the lines be low, then close the link."""
        self._outputs.close()
        self._link.close()


def open_outputs(scenario: Resolved) -> OutputProcess | None:
    """Start the process of the lines where the configuration names a chip.

    Raises: ConfigError in lockstep, whose time is nobody's; RunError when it does not come up
    """
    if scenario.outputs.chip is None:
        return None
    if scenario.loop.clock != "realtime":
        raise ConfigError("outputs.chip: accepted with loop.clock = 'realtime' only")
    return OutputProcess(scenario)


def with_outputs(connection: Connection, outputs: OutputProcess | None) -> Connection:
    """Return the connection that also shows what it sends to the lines, if there are any."""
    if outputs is None:
        return connection

    def close() -> None:
        outputs.close()
        connection.close()

    return connection._replace(link=OutputLink(connection.link, outputs), close=close)
