"""Processes that are stopped for a while, and runs that are asked to end at any moment."""

from __future__ import annotations

import json
import signal
import time
from collections import Counter
from typing import Final

from bench.trust.attack import Field, Tally
from bench.trust.victims import LINKS, Victim

_MOST_S: Final = 3.0
_INTERRUPTED: Final = 130
_ASKING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def interrupt(field: Field) -> Tally:
    """Ask a run to end while it comes up, runs and ends."""
    lost, worst_s, tries = [], 0.0, field.tries(4, 60)
    for number in range(tries):
        link = LINKS[number % len(LINKS)]
        with Victim(field.directory / "run", link, "--set", "run.duration_s=60") as victim:
            if number % 2:
                victim.wait_begun()
            time.sleep(field.dice.uniform(0.5, 2.0))
            victim.family()
            begin_s = time.monotonic()
            number_sent = field.dice.choice(_ASKING)
            victim.send("hil run", number_sent)
            outcome = victim.outcome()
            took_s = time.monotonic() - begin_s if outcome.left else outcome.took_s
        worst_s = max(worst_s, took_s)
        ended = outcome.code == -number_sent and not number % 2  # the interpreter comes up itself
        told = len(outcome.lines) == 1 and outcome.lines[0].startswith("interrupted")
        right = ended or (outcome.code == _INTERRUPTED and told)
        if not right or outcome.left or took_s > _MOST_S:
            lost.append(f"{link}: exit {outcome.code} after {took_s:.1f} s, {outcome.lines[-1:]}")
        field.say(f"interrupt {number + 1} of {tries}: {link}, {took_s:.2f} s")
    return Tally(tries, tuple(lost), f"at most {worst_s:.1f} s")


def stop(field: Field) -> Tally:
    """Stop one side for a while: the verdict names the machine, or everything was met."""
    lost, tries = [], field.tries(2, 40)
    verdicts: Counter[str] = Counter()
    for number in range(tries):
        link = ("zenoh", "shm")[number % 2]
        with Victim(field.directory / "run", link, "--set", "run.duration_s=3") as victim:
            victim.wait_begun()
            side = field.dice.choice(("plant", "controller"))
            held_s = field.dice.uniform(0.01, 0.5)
            victim.send(side, signal.SIGSTOP)
            time.sleep(held_s)
            victim.send(side, signal.SIGCONT)
            outcome = victim.outcome()
        verdict = _verdict(victim)
        verdicts[verdict] += 1
        if outcome.left or (verdict, outcome.code) not in {("met", 0), ("blocked", 4)}:
            lost.append(f"{link}, {side} for {held_s * 1e3:.0f} ms: exit {outcome.code}, {verdict}")
        field.say(f"stop {number + 1} of {tries}: {link}, {side}, {held_s * 1e3:.0f} ms: {verdict}")
    told = ", ".join(f"{name} {count}" for name, count in sorted(verdicts.items()))
    return Tally(tries, tuple(lost), told)


def _verdict(victim: Victim) -> str:
    try:
        return str(json.loads(victim.files.summary.read_text(encoding="utf-8"))["verdict"])
    except (OSError, ValueError, KeyError):
        return "no summary"
