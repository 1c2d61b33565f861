"""A loop as a service: endless, heard by its manager, told new set points without a restart.

All of it happens in the loop's own thread, a few times a second between two ticks: a watchdog
that another thread feeds would say nothing about the loop.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType
from typing import Any, Final

from drivers.system.keepsake import Keepsake
from drivers.system.notify import Notifier
from drivers.system.process import Stop
from drivers.system.realtime import page_faults
from hil.errors import ConfigError, LinkError, RefusedError
from hil.ports import Link
from hil.values import NEVER

BEAT_S: Final = 0.05
"""Between two looks at the outside; readiness and a reload are at most this late."""

STATUS_S: Final = 1.0
WARM_UP_S: Final = 2.0
"""After this no page fault is expected in the loop."""

KEPT_LOGS: Final = 20
PREPARED: Final = "set-points.json"
"""File in the runtime directory that a reload reads: a command, checked outside the loop."""

_SLICE_S: Final = 0.5
_MOST_BYTES: Final = 512


class Heart:
    """What a loop asks between two ticks: `if tick >= heart.next_tick: heart.beat(...)`.

    A run that is no service has one too; its next tick never comes.
    """

    def __init__(self, notifier: Notifier | None = None, rate_hz: int = 0) -> None:
        self.next_tick = NEVER
        self.ready = False
        self.faults = 0
        self._notifier = notifier
        self._every = max(round(rate_hz * BEAT_S), 1)
        self._status_every = max(round(rate_hz * STATUS_S), 1)
        self._warm_up = round(rate_hz * WARM_UP_S)
        self._next_status = 0
        self._base: int | None = None
        self._reload = False

    def start(self, tick: int) -> None:
        """Begin to beat with the tick from which the loop runs."""
        if self._notifier is None:
            return
        self.next_tick = tick
        self._next_status = tick
        self._warm_up += tick
        signal.signal(signal.SIGHUP, self._asked_to_reload)

    def _asked_to_reload(self, _number: int, _frame: FrameType | None) -> None:
        self._reload = True

    def beat(self, tick: int, answered: bool, describe: Callable[[], str]) -> bool:
        """Feed the watchdog, tell the status; returns whether a reload was asked for."""
        assert self._notifier is not None
        self.next_tick = tick + self._every
        self._count_faults(tick)
        if answered and not self.ready:
            self.ready = True
            self._notifier.ready(self._status(describe))
        self._notifier.feed()
        if tick >= self._next_status:
            self._next_status = tick + self._status_every
            self._notifier.status(self._status(describe))
        asked, self._reload = self._reload, False
        return asked

    def _count_faults(self, tick: int) -> None:
        if tick < self._warm_up:
            return
        minor, major = page_faults()
        if self._base is None:
            self._base = minor + major
        self.faults = minor + major - self._base

    def _status(self, describe: Callable[[], str]) -> str:
        return f"{describe()}; page faults since warm-up {self.faults}"


class Service:
    """One process under a service manager.

    What it keeps for a successor, and what a reload hands in, are files in the directory that the
    service manager names in RUNTIME_DIRECTORY; without one nothing is kept.
    """

    def __init__(
        self, process: str, rate_hz: int, environment: Mapping[str, str] = os.environ
    ) -> None:
        self.notifier = Notifier(environment)
        self.heart = Heart(self.notifier, rate_hz)
        self._process = process
        runtime = environment.get("RUNTIME_DIRECTORY", "")
        self._directory = Path(runtime) if runtime else None
        self._keepsake = Keepsake(Path(runtime) / "duty.json") if runtime else None

    def say(self, text: str) -> None:
        """Put one line into the journal."""
        print(f"{self._process}: {text}", file=sys.stderr, flush=True)

    def wait_for_peer(self, link: Link, peer: str, timeout_s: float, stop: Stop) -> None:
        """Wait for the peer, in slices that a request to end can interrupt.

        Raises: LinkError when it does not come within the time, RefusedError when it has another
        """
        line = f"waiting for the {peer}, up to {timeout_s:g} s"
        self.say(line)
        self.notifier.waiting(line, 2.0 * timeout_s)
        left_s = timeout_s
        while not stop.requested:
            left_s -= _SLICE_S
            try:
                link.wait_for_peer(_SLICE_S)
            except RefusedError:
                raise
            except LinkError:
                if left_s > 0.0:
                    continue
                raise LinkError(f"no {peer} within {timeout_s:g} s") from None
            self.say(f"the {peer} is there")
            return

    def ends(self) -> None:
        """Say that the end was asked for."""
        self.notifier.stopping()

    def kept(self) -> Mapping[str, Any]:
        """Return what a predecessor kept."""
        return {} if self._keepsake is None else self._keepsake.read()

    def keep(self, facts: Mapping[str, Any]) -> None:
        """Keep these facts for a successor."""
        if self._keepsake is not None:
            self._keepsake.keep(facts)

    def prepared(self) -> bytes | None:
        """Return the set points that a reload has prepared."""
        if self._directory is None:
            self.say("reload refused: RUNTIME_DIRECTORY is not set")
            return None
        path = self._directory / PREPARED
        try:
            with path.open("rb") as file:
                return file.read(_MOST_BYTES)
        except OSError as error:
            self.say(f"reload refused: {path}: {error.strerror}")
            return None


def log_file(directory: Path, process: str) -> Path:
    """Return a new file for the log of this start; of the older ones the newest are kept.

    Raises: ConfigError when the directory cannot be used
    """
    try:
        older = sorted(directory.glob(f"{process}-*.mcap"), key=lambda path: path.stat().st_mtime)
        for path in older[: max(len(older) - KEPT_LOGS + 1, 0)]:
            path.unlink()
    except OSError as error:
        raise ConfigError(f"log directory {directory}: {error.strerror}") from None
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    return directory / f"{process}-{stamp}-{os.getpid()}.mcap"
