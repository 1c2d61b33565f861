"""Logs that were cut, flipped or run out of room: no reader takes one for what it is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from bench.logs.repair import repair
from bench.trust.attack import Field, Tally
from bench.trust.victims import Victim
from hil import log as logs
from hil.errors import HilError
from hil.log.verify import verify

_SHORT: Final = ("--clock", "lockstep", "--set", "run.duration_s=0.4")


def flip(field: Field) -> Tally:
    """Flip one bit: it is seen by `--verify`, or nothing that a reader uses has changed."""
    log = _log(field)
    whole, data = _contents(log), log.read_bytes()
    lost, harmless, tries = [], 0, field.tries(60, 2000)
    for _ in range(tries):
        place, bit = field.dice.randrange(len(data)), field.dice.randrange(8)
        damaged = bytearray(data)
        damaged[place] ^= 1 << bit
        victim = field.directory / "flipped.mcap"
        victim.write_bytes(damaged)
        if _is_sound(victim):
            harmless += 1
            if _contents(victim) != whole:
                lost.append(f"byte {place}, bit {bit}: unseen")
    return Tally(tries, tuple(lost), f"{harmless} in bytes that no reader uses")


def cut(field: Field) -> Tally:
    """Cut a log anywhere: it is refused, and what `repair` saves is its beginning, and sound."""
    log = _log(field)
    whole, data = _contents(log), log.read_bytes()
    lost, saved, tries = [], 0, field.tries(20, 300)
    for _ in range(tries):
        size = field.dice.randrange(len(data))
        victim, mended = field.directory / "cut.mcap", field.directory / "mended.mcap"
        victim.write_bytes(data[:size])
        mended.unlink(missing_ok=True)
        if _is_sound(victim):
            lost.append(f"cut at {size}: taken for whole")
        try:
            repair(victim, mended)
        except HilError:
            continue  # nothing whole was there
        saved += 1
        if not _is_sound(mended) or not _begins_with(whole, _contents(mended)):
            lost.append(f"cut at {size}: repaired wrongly")
    return Tally(tries, tuple(lost), f"{saved} repaired, the rest had no whole chunk")


def run_out_of_room(field: Field) -> Tally:
    """No file may grow any more: one line with the file's name, exit 3, both logs sound."""
    lost, tries = [], field.tries(1, 4)
    for number in range(tries):
        link = ("memory", "zenoh")[number % 2]
        long = ("--clock", "lockstep", "--set", "run.duration_s=80")
        with Victim(field.directory / "run", link, *long, limit="ulimit -f 8400") as victim:
            outcome = victim.outcome(240.0)
        told = len(outcome.lines) == 1 and ".mcap" in outcome.lines[0]
        sound = all(log.exists() and _is_sound(log) for log in victim.logs)
        if outcome.code != 3 or not told or outcome.left or not sound:
            lost.append(f"{link}: exit {outcome.code}, sound {sound}, {outcome.lines[-1:]}")
        field.say(f"room {number + 1} of {tries}: {link}: exit {outcome.code}")
    return Tally(tries, tuple(lost))


def _log(field: Field) -> Path:
    with Victim(field.directory / "sound", "memory", *_SHORT) as victim:
        victim.outcome()
    return victim.logs[0]


def _is_sound(path: Path) -> bool:
    try:
        verify(path)
    except HilError:
        return False
    return True


def _contents(path: Path) -> dict[str, Any]:
    """Everything that a reader gets from a log, by what it is called."""
    try:
        with logs.open(path) as log:
            found: dict[str, Any] = {name: list(log.records(name)) for name in log.topics}
            return found | {"metadata": log.metadata, "attachments": log.attachments}
    except HilError as error:
        return {"error": str(error)}


def _begins_with(whole: dict[str, Any], part: dict[str, Any]) -> bool:
    """Whether each topic of a part is the beginning of the same in the whole, to the byte."""
    rows = [(whole[name], rows) for name, rows in part.items() if name.startswith("/")]
    return all(repr(had[: len(rows)]) == repr(rows) for had, rows in rows)
