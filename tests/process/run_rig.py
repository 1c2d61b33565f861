"""A run with real processes to do something to: started, followed by the size of its logs, left."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

HIL = [sys.executable, "-m", "bench.cli"]
PATIENCE_S = 40.0
"""On a machine that runs other tests meanwhile."""


def start(out, *arguments, scenario="steady", duration_s=60.0, **options):
    """Start a long run and wait until both its logs are being written."""
    command = [*HIL, "run", scenario, *arguments, "--no-report", "--out", str(out)]
    command += ["--set", f"run.duration_s={duration_s}"]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    process = subprocess.Popen(command, start_new_session=True, **options)
    logs = [out / "plant.mcap", out / "controller.mcap"]
    wait_until(
        lambda: (
            process.poll() is not None
            or all(log.exists() and log.stat().st_size > 80_000 for log in logs)
        ),
        f"{out}: two logs",
    )
    assert process.poll() is None, process.communicate()
    return process


def wait_until(happened, what):
    """Wait for something, as long as a busy machine may take."""
    end_s = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < end_s, f"not within {PATIENCE_S:g} s: {what}"
        time.sleep(0.01)


def children_of(pid):
    """Return the process numbers of a process's children by module name."""
    return {module: child for child, module in _modules_below(pid)}


def recorders_of(pid):
    """Return the process numbers of the recorders that a process has started."""
    return [child for child, module in _modules_below(pid) if "recorder" in module]


def _modules_below(pid):
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
            command = (status.parent / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if parent == pid and "-m" in command:
            yield int(status.parent.name), command[command.index("-m") + 1]


def family(process):
    """Return every process of a run by name: run, plant, controller, both recorders."""
    loops = {name.split(".")[0]: pid for name, pid in children_of(process.pid).items()}
    found = {"run": process.pid, **loops}
    for name, pid in loops.items():
        for number, recorder in enumerate(sorted(recorders_of(pid))):
            found[f"{name} recorder{number or ''}"] = recorder
    return found


def is_alive(pid):
    """Whether a process runs; one that has ended and was not fetched yet does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def wait_gone(pids):
    """Wait until none of them runs."""
    wait_until(lambda: not any(map(is_alive, pids)), f"the end of {pids}")


@contextlib.contextmanager
def ended(process):
    """Leave nothing of a run that a test has failed on."""
    try:
        yield process
    finally:
        for pid in (process.pid, *children_of(process.pid).values()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.communicate()
