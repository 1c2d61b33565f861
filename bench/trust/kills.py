"""SIGKILL to any process of a run at any moment: nobody goes on, the next start goes, logs stay."""

from __future__ import annotations

import signal
import time
from collections import Counter
from typing import Final

from bench.logs.mending import mend
from bench.trust.attack import Field, Tally
from bench.trust.victims import LINKS, Outcome, Victim
from drivers.recorder.output import wait_finished
from hil import log as logs
from hil.errors import HilError
from hil.log import Log

_LATEST_S: Final = 2.0
_MOST_LOST_MS: Final = 100
_LOG_TIMEOUT_S: Final = 20.0
_UNMEASURED: Final = {"hil run", "loops"}
"""Nothing of these is lost by a kill, or nobody is left to compare with."""

_KILLED: Final = -int(signal.SIGKILL)


def kill(field: Field) -> Tally:
    """Kill one process of a run, over each link in turn; the next try is the next start."""
    lost: list[str] = []
    whom: Counter[str] = Counter()
    worst_ms, measured, tries = 0, 0, field.tries(8, 200)
    for number in range(tries):
        link = LINKS[number % len(LINKS)]
        with Victim(field.directory / "run", link, "--set", "run.duration_s=60") as victim:
            begun = number % 5 == 4  # one in five is killed while it comes up
            begun = not begun and victim.wait_begun()
            time.sleep(field.dice.uniform(0.0 if begun else 0.3, _LATEST_S))
            name = field.dice.choice(sorted(victim.family()))
            victim.send(name, signal.SIGKILL)
            outcome = victim.outcome()
        whom[name.split(" recorder")[0] if "recorder" not in name else "recorder"] += 1
        why, lost_ms = _judge(victim, name, outcome, begun=begun)
        worst_ms = max(worst_ms, lost_ms)
        measured += begun and name not in _UNMEASURED
        lost += [f"{link}, {name}: {why}"] if why else []
        field.say(f"kill {number + 1} of {tries}: {link}, {name}: {why or 'ok'}, {lost_ms} ms")
    lost += [
        f"the start after the last one, {link}: {why}"
        for link in LINKS
        if (why := _start(field, link))
    ]
    told = ", ".join(f"{name} {count}" for name, count in sorted(whom.items()))
    missing = f"at most {worst_ms} ms missing in a log, measured in {measured}"
    return Tally(tries, tuple(lost), f"{told}; {missing}")


def _start(field: Field, link: str) -> str:
    """Return why a short run over a link does not do; empty when it does."""
    short = ("--clock", "lockstep", "--set", "run.duration_s=0.1")
    with Victim(field.directory / "next", link, *short) as victim:
        outcome = victim.outcome()
    return "" if outcome.code == 0 else f"exit {outcome.code}, {outcome.lines[-1:]}"


def _judge(victim: Victim, name: str, outcome: Outcome, *, begun: bool) -> tuple[str, int]:
    """Return what was not as promised, and how much of a log is missing [ms]."""
    if outcome.left:
        return f"left running: {', '.join(outcome.left)}", 0
    if name == "hil run":
        if outcome.code != _KILLED or outcome.lines:
            return f"exit {outcome.code}, {outcome.lines[-1:]}", 0
    elif outcome.code != 3 or len(outcome.lines) != 1:
        return f"exit {outcome.code} with {len(outcome.lines)} lines: {outcome.lines[-1:]}", 0
    if not begun:
        return "", 0
    try:
        return _judge_logs(victim, name)
    except HilError as error:
        return str(error), 0


def _judge_logs(victim: Victim, name: str) -> tuple[str, int]:
    """Read both logs; a killed starter is told in them, and what is missing is measured."""
    for path in victim.logs:
        wait_finished(path, _LOG_TIMEOUT_S)
        mend(path)
    with logs.open(victim.logs[0]) as plant, logs.open(victim.logs[1]) as controller:
        if name == "hil run":
            silent = [
                log.path.name for log in (plant, controller) if not _tells(log, "starter-lost")
            ]
            return (f"no reason in {', '.join(silent)}" if silent else ""), 0
        missing_ms = max(_hole_ms(log) for log in (plant, controller))
        if name in {"plant", "controller"}:
            pair = (plant, controller) if name == "plant" else (controller, plant)
            missing_ms = max(missing_ms, _behind_ms(*pair))
    late = f"{missing_ms} ms are missing" if missing_ms > _MOST_LOST_MS else ""
    return late, missing_ms


def _tells(log: Log, code: str) -> bool:
    return any(record.code == code for record in log.records("/event"))


def _hole_ms(log: Log) -> int:
    """What is missing between the parts of a log, which a lost recorder has left [ms]."""
    if len(log.parts) == 1:
        return 0
    ticks = log.array("/timing")["tick"].astype("i8")
    return max(0, int((ticks[1:] - ticks[:-1]).max()) - 1) if len(ticks) > 1 else 0


def _behind_ms(killed: Log, survivor: Log) -> int:
    """What the other one has heard of and the log of the killed one has not [ms]."""
    last = killed.array("/timing")["tick"]
    heard = survivor.array("/timing")["used_tick"].astype("i8")
    return max(0, int(heard.max(initial=0)) - int(last[-1])) if len(last) else int(heard.max())
