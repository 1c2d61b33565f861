"""What a run takes of the processor: the loop's process with all its threads, and its recorder."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any, Final

from drivers.recorder.client import NullRecorder, Recorder
from hil import compiled

_TICKS_PER_S: Final = os.sysconf("SC_CLK_TCK")


class Effort:
    """Counts from its making on."""

    def __init__(self, recorder: Recorder | NullRecorder) -> None:
        self._recorder = recorder.pid
        self._wall_s = time.perf_counter()
        self._cpu_s = time.process_time()
        self._recorder_s = _cpu_of(self._recorder)

    def told(self) -> dict[str, Any]:
        """Return the time that has passed and the processor times in it [s]."""
        return {
            "loop_s": time.perf_counter() - self._wall_s,
            "cpu_s": time.process_time() - self._cpu_s,
            "recorder_cpu_s": _cpu_of(self._recorder) - self._recorder_s,
            "compiled": compiled.in_force(),
        }


def _cpu_of(pid: int | None) -> float:
    """User and system time of another process; 0 when there is none of ours [s]."""
    if pid is None:
        return 0.0
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except OSError:
        return 0.0
    fields = stat.rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S
