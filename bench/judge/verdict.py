"""Whether a run was as its scenario expects."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from bench.judge.figures import RunData
from bench.judge.strokes import peak_error_m, settling_ns
from hil.config.scenario import Expectation

AT_REST_M_S = 0.01


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
    settling = settling_ns(data.strokes, begin_ns, limit_mm * 1e-3)
    wanted = f"TDC within ±{limit_mm:g} mm{_since(expectation)}"
    if settling is None:
        return None, False, f"{wanted}: not reached"
    settled_s = settling * 1e-9
    met = settled_s <= expectation.after_s
    judged = data.strokes.since(begin_ns + expectation.after_s * 1e9)
    if met and not len(judged.t_ns):
        return None, False, f"{wanted}: the run ends before"
    told = "it was never left" if settling == 0 else f"settled after {settled_s * 1e3:.1f} ms"
    return settled_s, met, f"{wanted}: {told}"


def _peak(data: RunData, expectation: Expectation, begin_ns: int) -> Judged:
    limit_mm = expectation.peak_mm or 0.0
    peak = peak_error_m(data.strokes, begin_ns + expectation.after_s * 1e9)
    wanted = f"TDC error at most {limit_mm:g} mm{_since(expectation)}"
    if peak is None:
        return None, False, f"{wanted}: no dead centre"
    return peak * 1e3, peak * 1e3 <= limit_mm, f"{wanted}: {peak * 1e3:.3f} mm"


def _mode(data: RunData, expectation: Expectation, _: int) -> Judged:
    text = f"ends in mode {expectation.mode}: {data.mode}"
    return data.mode, data.mode == expectation.mode, text


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
