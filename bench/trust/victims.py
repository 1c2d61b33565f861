"""A run of real processes to attack: started, looked at from outside, and seen to its end."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Final, NamedTuple

from bench.run.directory import RunFiles
from drivers.can.virtual.directory import DIRECTORY_VARIABLE

LINKS: Final = ("zenoh", "memory", "shm", "can")
PATIENCE_S: Final = 40.0
_BEGUN_BYTES: Final = 60_000
"""What a log says of itself is half of that."""
_ROLES: Final = {
    "plant.main": "plant", "controller.main": "controller", "bench.run.single_process": "loops",
}  # fmt: skip
_RECORDER: Final = "drivers.recorder.process"


class Outcome(NamedTuple):
    """How a run ended: exit code, lines of standard error, time, and what was left running."""

    code: int
    lines: list[str]
    took_s: float
    left: list[str]


class Victim:
    """One `hil run`; what it starts is found by its parents."""

    def __init__(self, out: Path, link: str, *arguments: str, limit: str = "true") -> None:
        self.files = RunFiles(out)
        shutil.rmtree(out, ignore_errors=True)
        words = [sys.executable, "-m", "bench.cli", "run", "steady", "--no-report", "--link", link]
        words += ["--bus", "zenoh:trust"] if link == "can" else []
        self._process = subprocess.Popen(
            ["bash", "-c", f'{limit}; exec "$@"', "-", *words, *arguments, "--out", str(out)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True, start_new_session=True,
            env={**os.environ, DIRECTORY_VARIABLE: str(out.parent / "can")},
        )  # fmt: skip
        self._seen: dict[str, int] = {}

    def __enter__(self) -> Victim:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave nothing of it, whatever an attack came to."""
        for pid in {self._process.pid, *self.family().values(), *self._seen.values()}:
            if self._process.poll() is None or _runs(pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        if self._process.poll() is None:
            self._process.communicate()

    @property
    def logs(self) -> tuple[Path, Path]:
        """Both logs."""
        return self.files.plant_log, self.files.controller_log

    def wait_begun(self) -> bool:
        """Return when both logs are being written; whether they are."""
        end_s = time.monotonic() + PATIENCE_S
        while self._process.poll() is None and time.monotonic() < end_s:
            if all(log.exists() and log.stat().st_size > _BEGUN_BYTES for log in self.logs):
                return True
            time.sleep(0.005)
        return False

    def family(self) -> dict[str, int]:
        """Return the processes of the run that are there by now, by name."""
        found = {"hil run": self._process.pid}
        for pid, module in _below(self._process.pid):
            name = _ROLES.get(module)
            if name is None:
                continue
            found[name] = pid
            recorders = sorted(child for child, what in _below(pid) if what == _RECORDER)
            found |= {f"{name} recorder {n}": child for n, child in enumerate(recorders)}
        self._seen |= found
        return found

    def send(self, name: str, number: signal.Signals) -> bool:
        """Send a signal to one of them; whether it was there."""
        pid = self.family().get(name)
        if pid is None:
            return False
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)
        return True

    def outcome(self, patience_s: float = PATIENCE_S) -> Outcome:
        """Wait for the end of all of them."""
        begin_s = time.monotonic()
        try:
            _, errors = self._process.communicate(timeout=patience_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            _, errors = self._process.communicate()
        took_s = time.monotonic() - begin_s
        end_s = time.monotonic() + PATIENCE_S
        while (left := self._left()) and time.monotonic() < end_s:
            time.sleep(0.01)
        return Outcome(self._process.returncode, errors.splitlines(), took_s, left)

    def _left(self) -> list[str]:
        return [name for name, pid in self._seen.items() if _runs(pid)]


def let_hear() -> None:
    """Let victims hear every signal: what a script has in its background is born deaf to some."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


def _below(pid: int) -> list[tuple[int, str]]:
    """Return number and module of the Python processes that a process has started."""
    found = []
    for place in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            for child in map(int, place.read_text().split()):
                words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
                if "-m" in words:
                    found.append((child, words[words.index("-m") + 1]))
    return found


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False
