"""The verdict as it forms: the run's own judge, on the logs so far, again and again.

A process of its own, of the lowest priority: judging reads all of both logs, and takes the longer
the longer the run is. It waits four times as long as it judged.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from bench.judge.checks import judge
from bench.judge.figures import read_run
from bench.logs.repair import repair
from bench.run.directory import RunFiles
from hil.config.resolved import read_resolved
from hil.errors import HilError, LogError
from hil.log.part import open_part
from hil.log.segments import segments_before

_LEAST_S: Final = 1.0
_SHARE: Final = 4.0
_FINISHED: Final = ("verdict", "exit_reason")


def verdict_so_far(files: RunFiles) -> dict[str, Any]:
    """Judge what is there of a run.

    Raises: HilError when there is nothing to read yet
    """
    with tempfile.TemporaryDirectory(prefix="hil-judge-") as folder:
        copies = RunFiles(Path(folder))
        _copy_whole(files.plant_log, copies.directory)
        _copy_whole(files.controller_log, copies.directory)
        data = read_run(read_resolved(files.scenario), copies)
    told: dict[str, Any] = {
        "t_s": data.truth.end_ns * 1e-9,
        "expectations": [check._asdict() for check in judge(data)],
    }
    if files.summary.exists():
        summary = json.loads(files.summary.read_text(encoding="utf-8"))
        told |= {key: summary.get(key) for key in _FINISHED} | {"report": files.report.exists()}
    return told


def _copy_whole(log: Path, directory: Path) -> None:
    """Make a log that is being written readable elsewhere: what is whole of it by now.

    Raises: HilError when nothing is
    """
    for part in (*segments_before(log), log):
        there = directory / part.name
        try:
            open_part(part).file.close()
            there.symlink_to(part.absolute())
        except LogError:
            repair(part, there)


def main(directory: Path) -> None:
    """Tell the verdict so far as lines of JSON, until it is the last one or nobody listens."""
    os.nice(19)
    files = RunFiles(directory)
    while True:
        begun_s = time.monotonic()
        told: dict[str, Any] = {}
        try:
            told = verdict_so_far(files)
            print(json.dumps(told), flush=True)
        except BrokenPipeError:
            return
        except (HilError, OSError, ValueError):
            pass  # a log that is just being written; it will be read the next time
        if "verdict" in told:
            return
        time.sleep(max(_LEAST_S, _SHARE * (time.monotonic() - begun_s)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
