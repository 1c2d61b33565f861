"""Benchmark of everything that reads a log, on a long one: `python -m bench.measure.long_log`.

Makes a run of an hour at 1 kHz (3.6 million ticks) where there is none yet, then runs each command
in a process of its own and prints its time, rate and peak memory.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from bench.report.quantities import bytes_text, thousands
from hil import log as logs

_HIL = (sys.executable, "-m", "bench.cli")


class Measured(NamedTuple):
    """One command: what it took."""

    name: str
    seconds: float
    peak_bytes: int
    exit_code: int


def main() -> int:
    """Make the log if need be, and measure."""
    parser = argparse.ArgumentParser(prog="long_log", description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--out", type=Path, default=Path("runs/long-log"))
    given = parser.parse_args()
    directory: Path = given.out
    log = directory / "plant.mcap"
    if not log.exists():
        _make(directory, given.hours)
    with logs.open(log) as opened:
        messages = sum(topic.messages for topic in opened.topics.values())
        seconds = opened.end_ns * 1e-9
    size = bytes_text(log.stat().st_size)
    print(f"{log}: {seconds:.0f} s, {thousands(messages)} messages, {size}")
    _show([measure(name, command) for name, command in _commands(directory)], messages, seconds)
    return 0


def _make(directory: Path, hours: float) -> None:
    """Run the engine in memory and lockstep for that long.

    Raises: CalledProcessError when the run fails
    """
    print(f"making {hours:g} h of log in {directory}", flush=True)
    command = (
        *_HIL, "run", "steady", "--link", "memory", "--clock", "lockstep", "--no-report",
        "--out", str(directory), "--set", f"run.duration_s={hours * 3600.0}",
    )  # fmt: skip
    subprocess.run(command, check=True)


def _commands(directory: Path) -> list[tuple[str, tuple[str, ...]]]:
    plant, controller = str(directory / "plant.mcap"), str(directory / "controller.mcap")
    exported = directory / "parquet"
    shutil.rmtree(exported, ignore_errors=True)
    repaired = directory / "plant.repaired.mcap"
    repaired.unlink(missing_ok=True)
    return [
        ("info", ("info", plant)),
        ("export to parquet", ("export", plant, "--out", str(exported))),
        ("diff with itself", ("diff", plant, plant)),
        ("repair", ("repair", plant, "--out", str(repaired))),
        ("replay of the controller", ("replay", controller)),
        ("replay of the plant", ("replay", plant)),
        ("report", ("report", str(directory))),
    ]


def measure(name: str, command: tuple[str, ...]) -> Measured:
    """Run one command of `hil` and return what it took."""
    before_s = time.perf_counter()
    process = subprocess.Popen((*_HIL, *command), stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - before_s
    process.returncode = os.waitstatus_to_exitcode(status)
    return Measured(name, seconds, usage.ru_maxrss * 1024, process.returncode)


def _show(rows: list[Measured], messages: int, simulated_s: float) -> None:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("command", "time [s]", "messages/s", "× real time", "peak memory", "exit"):
        table.add_column(title, justify="left" if title == "command" else "right")
    for row in rows:
        table.add_row(
            row.name, f"{row.seconds:.2f}", thousands(round(messages / row.seconds)),
            f"{simulated_s / row.seconds:.0f}", bytes_text(row.peak_bytes), str(row.exit_code),
        )  # fmt: skip
    Console(highlight=False).print(table)


if __name__ == "__main__":
    sys.exit(main())
