"""Whether a run was as its scenario expects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from bench.judge.cause import Cause
from bench.judge.figures import RunData
from bench.judge.response import response, settled_after_s
from controller.build import initial_mode
from hil.config.scenario import Expectation
from hil.errors import BlockedError

AT_REST_M_S = 0.01


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


class Check(NamedTuple):
    """One expectation with what was found; `found` is None when there was nothing to judge."""

    name: str
    key: str
    expected: Any
    found: Any
    met: bool
    text: str


def judge(data: RunData) -> list[Check]:
    """Hold the run against each expectation of its scenario, in the scenario's order."""
    checks: list[Check] = []
    for name, expectation in data.scenario.expect.items():
        begin_ns = data.instant_ns(expectation.event)
        given = expectation.model_dump(exclude_none=True)
        keys = [key for key in _JUDGES if key in given]
        checks += [_check(name, key, data, expectation, begin_ns) for key in keys]
    return checks


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


def _check(
    name: str, key: str, data: RunData, expectation: Expectation, begin_ns: int | None
) -> Check:
    expected = getattr(expectation, key)
    if begin_ns is None:
        text = f"event {expectation.event!r} did not happen"
        return Check(name, key, expected, None, met=False, text=text)
    found, met, text = _JUDGES[key](data, expectation, begin_ns)
    return Check(name, key, expected, found, met=met, text=text)


Judged = tuple[Any, bool, str]


def _since(expectation: Expectation) -> str:
    """Say from when on an expectation holds."""
    if not expectation.after_s:
        return f" from {expectation.event} on" if expectation.event else " throughout"
    origin = f"after {expectation.event}" if expectation.event else "after the start"
    return f" from {expectation.after_s * 1e3:g} ms {origin} on"


def _within(data: RunData, expectation: Expectation, begin_ns: int) -> Judged:
    """Settled by then: the first dead centre after the last one outside comes no later."""
    limit_mm = expectation.within_mm or 0.0
    settled_s = settled_after_s(response(data.strokes, begin_ns), limit_mm)
    wanted = f"TDC within ±{limit_mm:g} mm{_since(expectation)}"
    if settled_s is None:
        return None, False, f"{wanted}: not reached"
    met = settled_s <= expectation.after_s
    judged = data.strokes.since(begin_ns + expectation.after_s * 1e9)
    if met and not len(judged.t_ns):
        return None, False, f"{wanted}: the run ends before"
    told = "it was never left" if settled_s == 0.0 else f"settled after {settled_s * 1e3:.1f} ms"
    return settled_s, met, f"{wanted}: {told}"


def _peak(data: RunData, expectation: Expectation, begin_ns: int) -> Judged:
    limit_mm = expectation.peak_mm or 0.0
    found = response(data.strokes, begin_ns + round(expectation.after_s * 1e9))
    wanted = f"TDC error at most {limit_mm:g} mm{_since(expectation)}"
    if not found.errors_mm:
        return None, False, f"{wanted}: no dead centre"
    return found.peak_mm, found.peak_mm <= limit_mm, f"{wanted}: {found.peak_mm:.3f} mm"


def _mode(data: RunData, expectation: Expectation, _: int) -> Judged:
    wanted = str(expectation.mode)
    if wanted == "running":
        wanted = initial_mode(data.scenario.controller.model_copy(update={"running": True})).name
    wanted = wanted.lower()
    return data.mode, data.mode == wanted, f"ends in mode {wanted}: {data.mode}"


def _at_rest(data: RunData, expectation: Expectation, _: int) -> Judged:
    speed = data.truth.last_speed_m_s
    at_rest = speed < AT_REST_M_S
    wanted = "ends at rest" if expectation.at_rest else "ends in motion"
    return at_rest, at_rest == expectation.at_rest, f"{wanted}: last speed {speed:.3f} m/s"


def _contacts(data: RunData, expectation: Expectation, _: int) -> Judged:
    found, most = data.truth.contacts, expectation.contacts or 0
    return found, found <= most, f"at most {most} head contacts: {found}"


def _misfires(data: RunData, expectation: Expectation, _: int) -> Judged:
    found, least = data.happenings.counts.get("misfire", 0), expectation.misfires_min or 0
    return found, found >= least, f"at least {least} misfires: {found}"


_JUDGES: dict[str, Callable[[RunData, Expectation, int], Judged]] = {
    "within_mm": _within,
    "peak_mm": _peak,
    "mode": _mode,
    "at_rest": _at_rest,
    "contacts": _contacts,
    "misfires_min": _misfires,
}
