"""How full the bus of a run was, and its frames as a CAN log."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from bench.bus import can_log
from bench.bus.load import of_logs
from bench.run.directory import RunFiles, opened
from hil.config.resolved import Resolved, read_resolved
from hil.files import Output
from hil.wire.busload import worst_load


def load(directory: Path, bitrate_bit_s: int | None) -> int:
    """Print how full the bus was."""
    files = opened(directory)
    scenario = read_resolved(files.scenario)
    bitrate = bitrate_bit_s or scenario.link.bitrate_bit_s
    print(line_of_figures(figures(scenario, files, bitrate)))
    return 0


def line_of_figures(told: dict[str, Any]) -> str:
    """Return the load in one line."""
    return (
        f"bus load {told['load_mean']:.1%} in the mean tick, {told['load_fullest_tick']:.1%} in"
        f" the fullest, {told['load_worst_possible']:.1%} at the worst possible"
        f" ({told['frames']} frames, {told['bitrate_bit_s']} bit/s)"
    )


def figures(
    scenario: Resolved, files: RunFiles, bitrate_bit_s: int | None = None
) -> dict[str, Any]:
    """Return what summary.json says of the bus of a run."""
    found = of_logs(str(files.plant_log), str(files.controller_log))
    rate, bitrate = scenario.loop.rate_hz, bitrate_bit_s or scenario.link.bitrate_bit_s
    mean, most = found.shares(rate, bitrate)
    return {
        "bus": scenario.link.bus,
        "bitrate_bit_s": bitrate,
        "frames": found.frames,
        "load_mean": mean,
        "load_fullest_tick": most,
        "load_worst_possible": worst_load(rate, bitrate),
    }


def write_can_log(file: Output, scenario: Resolved, files: RunFiles, started: str) -> int:
    """Write the frames of a run as a CAN log.

    Parameters: started : when the run began, as the summary says it
    """
    begin_ns = round(time.mktime(time.strptime(started[:19], "%Y-%m-%dT%H:%M:%S")) * 1e9)
    return can_log.write(file, scenario, files, begin_ns)
