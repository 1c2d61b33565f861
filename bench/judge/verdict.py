"""Whether a run was as its scenario expects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from bench.judge.cause import Cause
from bench.judge.checks import Check
from bench.judge.figures import RunData
from hil.errors import BlockedError

VERDICTS = {
    "met": "expectations met",
    "none": "nothing expected",
    "not met": "expectation not met",
    "blocked": "blocked: no verdict",
    "fault": "fault",
}
"""Every verdict of a run, with how it is told."""

NOT_MET = 1


class Verdict(NamedTuple):
    """What a run came to, the exit code of `hil run`, and why, in one line."""

    name: str
    exit_code: int
    reason: str


def refusals(data: RunData) -> list[str]:
    """Tell which orders were refused and what would have been accepted, one line each."""
    named = [(instant.refused, instant.name) for instant in data.instants if instant.refused]
    told = []
    for line in data.happenings.refusals:
        own = next((pair for pair in named if pair[0] == line.text), None)
        if own is not None:
            named.remove(own)
        who = line.source if own is None else f"event {own[1]!r}"
        told.append(f"{who} refused: {line.text}")
    return told


def conclude(
    checks: Sequence[Check], refused: Sequence[str], cause: Cause | None = None
) -> Verdict:
    """Return the verdict of a run that went to its end; a refused order outranks expectations.

    What the machine spoilt says nothing of the controller; what was met in spite of it was met.
    """
    failed = [check.text for check in checks if not check.met]
    why = [cause.text] if cause is not None and (cause.safe or failed) else []
    if refused:
        return Verdict("blocked", BlockedError.exit_code, "; ".join(refused))
    if failed and cause is not None and cause.by_machine:
        return Verdict("blocked", BlockedError.exit_code, "; ".join(why + failed))
    if failed:
        return Verdict("not met", NOT_MET, "; ".join(why + failed))
    if checks:
        return Verdict("met", 0, "; ".join(["every expectation met", *why]))
    return Verdict("none", 0, "; ".join([VERDICTS["none"], *why]))
