"""Expectations on the engine as a whole: its dead centres, its mode, what happened and in order."""

from __future__ import annotations

from typing import Final

from bench.judge.response import response, settled_after_s
from bench.judge.window import Case, Judged, superseded_ns, told
from controller.build import initial_mode
from hil.config.suite.expectation import Expectation

AT_REST_M_S: Final = 0.01


def within_mm(case: Case) -> Judged:
    """Settled by then: the first dead centre after the last one outside comes no later."""
    data, given, window = case
    limit_mm, begin_ns = given.within_mm or 0.0, window.start_ns
    strokes = data.strokes.part(data.strokes.t_ns <= superseded_ns(case))
    settled_s = settled_after_s(response(strokes, begin_ns), limit_mm)
    wanted = f"TDC within ±{limit_mm:g} mm{told(given, given.after_s)}"
    if settled_s is None:
        return None, False, f"{wanted}: not reached"
    met = settled_s <= given.after_s
    if met and not len(strokes.since(begin_ns + given.after_s * 1e9).t_ns):
        return None, False, f"{wanted}: the run ends before"
    how = "it was never left" if settled_s == 0.0 else f"settled after {settled_s * 1e3:.1f} ms"
    return settled_s, met, f"{wanted}: {how}"


def peak_mm(case: Case) -> Judged:
    """No dead centre is further off."""
    data, given, window = case
    limit_mm = given.peak_mm or 0.0
    strokes = data.strokes.part(data.strokes.t_ns <= window.end_ns)
    found = response(strokes, window.start_ns + round(given.after_s * 1e9))
    wanted = f"TDC error at most {limit_mm:g} mm{told(given, given.after_s)}"
    if not found.errors_mm:
        return None, False, f"{wanted}: no dead centre"
    return found.peak_mm, found.peak_mm <= limit_mm, f"{wanted}: {found.peak_mm:.3f} mm"


def mode(case: Case) -> Judged:
    """The operating mode at the end of the window."""
    data, wanted = case.data, str(case.expectation.mode)
    if wanted == "running":
        wanted = initial_mode(data.scenario.controller.model_copy(update={"running": True})).name
    end_ns = case.window.end_ns
    wanted, found = wanted.lower(), data.mode_at(end_ns)
    how = "ends in" if end_ns >= data.truth.end_ns else f"at {end_ns * 1e-9:g} s in"
    return found, found == wanted, f"{how} mode {wanted}: {found}"


def at_rest(case: Case) -> Judged:
    """Whether the run ends at rest."""
    speed = case.data.truth.last_speed_m_s
    at_rest = speed < AT_REST_M_S
    wanted = "ends at rest" if case.expectation.at_rest else "ends in motion"
    return at_rest, at_rest == case.expectation.at_rest, f"{wanted}: last speed {speed:.3f} m/s"


def contacts(case: Case) -> Judged:
    """At most so many contacts with a head."""
    given, most = case.expectation, case.expectation.contacts or 0
    found = len(case.instants_ns("contact")) if _has_window(given) else case.data.truth.contacts
    return found, found <= most, f"at most {most} head contacts: {found}"


def misfires_min(case: Case) -> Judged:
    """At least so many misfires."""
    found, least = len(case.instants_ns("misfire")), case.expectation.misfires_min or 0
    return found, found >= least, f"at least {least} misfires: {found}"


def _has_window(given: Expectation) -> bool:
    return bool(given.event or given.from_s or given.until_s or given.until_event)


def never(case: Case) -> Judged:
    """An event that does not happen."""
    name = str(case.expectation.never)
    times = case.instants_ns(name)
    wanted = f"no {name}{told(case.expectation)}"
    if times:
        return len(times), False, f"{wanted}: {len(times)}, first at {times[0] * 1e-9:.4f} s"
    return 0, True, f"{wanted}: none"


def order(case: Case) -> Judged:
    """Each event at or after the one before it; every one has to happen."""
    names, at_ns = case.expectation.order or (), case.window.start_ns
    wanted = f"{', then '.join(names)}{told(case.expectation)}"
    found: list[float] = []
    for name in names:
        later = [t for t in case.data.occurrences(name) if at_ns <= t <= case.window.end_ns]
        if not later:
            after = f" after {found[-1]:.4f} s" if found else ""
            return found, False, f"{wanted}: no {name}{after}"
        at_ns = later[0]
        found.append(at_ns * 1e-9)
    return found, True, f"{wanted}: {', '.join(f'{t_s:.4f}' for t_s in found)} s"
