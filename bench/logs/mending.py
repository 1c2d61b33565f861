"""What a killed recorder has left becomes a whole log again before anybody reads it."""

from __future__ import annotations

from pathlib import Path

from bench.logs.repair import repair
from drivers.recorder.output import wait_finished
from hil.errors import HilError, LogError, RunError
from hil.log.part import open_part
from hil.log.segments import segments_before


def mend(log: Path) -> None:
    """Repair in place those files of a log that were never finished, and that nobody writes.

    One without a whole chunk goes aside, so that the others can be read.
    """
    for part in (*segments_before(log), log):
        if part.exists() and not _is_whole(part) and not _is_written(part):
            _repair_in_place(part)


def _is_written(part: Path) -> bool:
    try:
        wait_finished(part, 0.0)
    except RunError:
        return True
    return False


def _is_whole(part: Path) -> bool:
    try:
        open_part(part).file.close()
    except LogError:
        return False
    return True


def _repair_in_place(part: Path) -> None:
    mended = part.with_name(f"{part.name}.mended")
    mended.unlink(missing_ok=True)
    try:
        repair(part, mended)
    except HilError:
        mended.unlink(missing_ok=True)
        part.rename(part.with_name(f"{part.name}.damaged"))
        return
    mended.replace(part)
