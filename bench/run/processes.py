"""Processes of a run: started, listened to, ended in order and by their own ids."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from bench.live.witness import Witness
from drivers.system import starter

SAFE_GRACE_S = 1.0
"""What the survivor of a lost peer is given to reach its safe state and to log it."""

FINISH_GRACE_S = 15.0
"""What the second process is given once the first has ended on time."""

END_GRACE_S = 5.0
"""From the request to end until a process is killed."""

INTERRUPT_GRACE_S = 1.5
"""The same where somebody waits for the end; what a recorder has is written in any case."""

_MAX_STDERR = 1 << 20

Status = Mapping[str, Any]


class Child:
    """One process of the run; what it prints as JSON lines is its status."""

    def __init__(self, name: str, process: asyncio.subprocess.Process) -> None:
        self.name = name
        self.pid = process.pid
        self.result: dict[str, Any] = {}
        self.witness = Witness(process.pid)
        self._process = process
        self._stderr = bytearray()
        self._reading: list[asyncio.Task[None]] = []

    @classmethod
    async def start(
        cls, name: str, module: str, arguments: Sequence[str], on_status: Callable[[Status], None]
    ) -> Child:
        """Start `python -m module` in a process group of its own, so that Ctrl-C is ours alone."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",
            "-m",
            module,
            *arguments,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
            env=starter.environment(),
        )
        child = cls(name, process)
        reading = (child._read_status(on_status), child._read_errors())
        child._reading = [asyncio.create_task(task) for task in reading]
        return child

    @property
    def exit_code(self) -> int | None:
        """None while it runs, negative for the signal that killed it."""
        return self._process.returncode

    @property
    def cause(self) -> str:
        """What befell it, and ended it; empty when nothing did."""
        return str(self.result.get("cause", ""))

    @property
    def errors(self) -> str:
        """What it wrote to standard error."""
        return self._stderr.decode(errors="replace")

    async def wait(self) -> int:
        """Wait until the process has ended."""
        return await self._process.wait()

    async def drain(self, timeout_s: float) -> None:
        """Read what it has written to the end; its recorder holds the pipe until it has ended."""
        _, late = await asyncio.wait(self._reading, timeout=timeout_s)
        for task in late:
            task.cancel()

    async def end(self, grace_s: float = END_GRACE_S) -> None:
        """Ask it to end, and kill it when it does not."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            if self.exit_code is not None:
                return
            with contextlib.suppress(ProcessLookupError):  # it ended in this very moment
                self._process.send_signal(number)
            await asyncio.wait([asyncio.create_task(self.wait())], timeout=grace_s)

    async def _read_status(self, on_status: Callable[[Status], None]) -> None:
        assert self._process.stdout is not None
        async for line in self._process.stdout:
            try:
                status = json.loads(line)
            except ValueError:
                continue  # a library that prints is no reason to lose a run
            if isinstance(status, dict):
                self.result = status
                on_status({"process": self.name, **status})

    async def _read_errors(self) -> None:
        assert self._process.stderr is not None
        while block := await self._process.stderr.read(4096):
            self._stderr += block
            del self._stderr[:-_MAX_STDERR]


class End(NamedTuple):
    """How the processes ended; `culprit` is the one that failed first."""

    interrupted: bool = False
    culprit: Child | None = None
    overdue: bool = False


async def supervise(children: Sequence[Child], interrupt: asyncio.Event) -> End:
    """Wait until all have ended; one that fails, or an interrupt, ends the others in order."""
    stop = asyncio.create_task(interrupt.wait())
    try:
        end = await _watch(children, stop)
    finally:
        stop.cancel()
        grace_s = INTERRUPT_GRACE_S if interrupt.is_set() else END_GRACE_S
        await asyncio.gather(*(child.end(grace_s) for child in children))
    return end


async def _watch(children: Sequence[Child], stop: asyncio.Task[Any]) -> End:
    waiting = {asyncio.create_task(child.wait()): child for child in children}
    await asyncio.wait([*waiting, stop], return_when=asyncio.FIRST_COMPLETED)
    if stop.done():
        return End(interrupted=True)
    culprit = _failed(children)
    grace_s = SAFE_GRACE_S if culprit else FINISH_GRACE_S
    rest = asyncio.gather(*waiting)
    await asyncio.wait([rest, stop], timeout=grace_s, return_when=asyncio.FIRST_COMPLETED)
    if culprit is not None:
        return End(culprit=_failed(children))
    if stop.done():
        return End(interrupted=True)
    late = next((child for child in children if child.exit_code is None), None)
    return End(culprit=late or _failed(children), overdue=late is not None)


def _failed(children: Sequence[Child]) -> Child | None:
    """Return the one that failed; a kill, or what befell a process, comes before what followed."""
    failed = [child for child in children if child.exit_code]
    return min(failed, key=lambda child: (child.exit_code or 0, not child.cause), default=None)
