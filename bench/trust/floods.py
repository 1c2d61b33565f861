"""Floods: more than anybody asked for, on every key that a run listens to."""

from __future__ import annotations

import json
import signal
import time
from typing import Final

import zenoh

from bench.trust.attack import Field, Tally
from bench.trust.victims import Victim
from drivers.zenoh.config import session_config
from hil.config.resolved import read_resolved
from hil.errors import HilError

_FOR_S: Final = 1.0
_KEYS: Final = ("command", "frames/plant", "frames/controller", "status/plant")
_SIZES: Final = (1, 300, 100_000)
_MOST_S: Final = 3.0


def flood(field: Field) -> Tally:
    """Put what is none of ours on a key, as fast as it goes; a stop still comes through."""
    lost, sent, tries = [], 0, field.tries(1, 12)
    for number in range(tries):
        key, size = _KEYS[number % len(_KEYS)], _SIZES[number % len(_SIZES)]
        with Victim(field.directory / "run", "zenoh", "--set", "run.duration_s=60") as victim:
            if not victim.wait_begun():
                lost.append(f"{key}: did not begin")
                continue
            victim.family()
            sent += _pour(victim, key, field.dice.randbytes(size))
            victim.send("hil run", signal.SIGINT)
            outcome = victim.outcome()
        if outcome.left or outcome.took_s > _MOST_S or outcome.code not in {3, 130}:
            lost.append(f"{key}, {size} bytes: exit {outcome.code} after {outcome.took_s:.1f} s")
        field.say(f"flood {number + 1} of {tries}: {key}, {size} bytes: exit {outcome.code}")
    return Tally(tries, tuple(lost), f"{sent} messages")


def _pour(victim: Victim, key: str, payload: bytes) -> int:
    scenario = read_resolved(victim.files.scenario)
    sent, end_s = 0, time.monotonic() + _FOR_S
    try:
        tree = session_config("bench", scenario.link.zenoh, lockstep=False)
        with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session:
            while time.monotonic() < end_s:
                session.put(f"hil/{scenario.link.zenoh.engine}/{key}", payload)
                sent += 1
    except (zenoh.ZError, HilError):
        return sent  # it was thrown out, which is as good
    return sent
