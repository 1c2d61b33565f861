"""One run of a campaign, and what is kept of it: pure in its index, whatever process runs it."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from typing import Any

from bench.judge.response import Response
from bench.run.offline import Course, Silence, simulate
from bench.studies.campaign.config import Campaign, Drawn, draw, scenario_of
from hil.config.resolved import Resolved
from hil.errors import ConfigError, RunError
from hil.values import NEVER

Row = dict[str, Any]

NOT_BEGUN = "not begun"
"""In place of a mode: the run was refused, as what cannot work is."""

FAILED = "failed"
"""In place of a mode: an engine that could not be followed, or one's own law or engine failed."""

BEFORE_S = 0.8
"""Strokes of so long before the disturbance give the scatter of the undisturbed engine."""


def run_many(campaign: Campaign, indices: list[int]) -> list[Row]:
    """Run some of a campaign's runs, in order."""
    return [run_one(campaign, index) for index in indices]


def run_one(campaign: Campaign, index: int) -> Row:
    """Run one: its draws and its figures, flat; a run that cannot begin says so in `note`."""
    drawn = draw(campaign, index)
    row: Row = {"run": index, **{f"set_{k}": v for k, v in drawn.facts.items()}}
    try:
        scenario = scenario_of(campaign, drawn)
        course = simulate(scenario, _silences(drawn, scenario.loop.rate_hz))
    except ConfigError as error:
        return row | _figures(None, math.nan, NOT_BEGUN) | {"note": str(error)}
    except RunError as error:
        return row | _figures(None, math.nan, FAILED) | {"note": str(error)}
    return row | measure(campaign, drawn, scenario, course)


def _silences(drawn: Drawn, rate_hz: float) -> tuple[Silence, ...]:
    """The silences of a run in ticks."""
    return tuple(
        Silence(round(begin_s * rate_hz), max(round(end_s * rate_hz), round(begin_s * rate_hz) + 1),
                of != "answers", of != "samples")
        for begin_s, end_s, of in drawn.silences
    )  # fmt: skip


def measure(campaign: Campaign, drawn: Drawn, scenario: Resolved, course: Course) -> Row:
    """Peak, settling, scatter, fuel, contacts and misfires of a run.

    Peak and settling count from the load step, or from the end of the ramp on for settling, to
    the first misfire after it.
    """
    ref_mm = scenario.controller.tdc_ref_m * 1e3
    begin_ns = round(campaign.load.at_s * 1e9)
    ends_ns = begin_ns + round(campaign.load.ramp_s * 1e9) * bool(drawn.facts.get("ramp"))
    misfires = [e.t_ns for e in course.events if e.code == "misfire"]
    until_ns = min((t for t in misfires if t >= begin_ns), default=NEVER)
    errors = [(dc.t_ns, abs(dc.x_m) * 1e3 - ref_mm) for dc in course.dead_centres]
    before = [e for t, e in errors if begin_ns - BEFORE_S * 1e9 <= t < begin_ns]
    calm = not any(begin_ns - 1e9 * BEFORE_S <= t < begin_ns for t in misfires)
    sigma = statistics.pstdev(before) if calm and len(before) > 1 else math.nan
    after = [(t, e) for t, e in errors if begin_ns <= t < until_ns]
    peak = max((abs(e) for _, e in after), default=math.nan)
    later = [((t - ends_ns) * 1e-9, e) for t, e in after if t >= ends_ns]
    response = Response(
        tuple(t for t, _ in later), tuple(e for _, e in later), 0.0 if math.isnan(sigma) else sigma
    )
    fuels = [dc.fuel_kg * 1e6 for dc in course.dead_centres if dc.fuel_kg > 0.0]
    counts = Counter(event.code for event in course.events)
    found = _figures(response, sigma, course.mode) | {
        "peak_mm": peak,
        "mean_mm": statistics.fmean(before) if before else math.nan,
        "fuel_mean_mg": statistics.fmean(fuels) if fuels else math.nan,
        "fuel_sigma_mg": statistics.pstdev(fuels) if fuels else math.nan,
        "contacts": counts["contact"],
        "misfires": counts["misfire"],
        "forced_misfires": sum(1 for key in drawn.overrides if key.startswith("events.misfire_")),
        "strokes": len(course.dead_centres),
    }
    if until_ns < NEVER and len(later) < 2 * 10:
        # A misfire came before anything could settle.
        found |= dict.fromkeys(("settling_ms", "settling_band_ms", "settling_mean_ms"), math.nan)
    return found


def _figures(response: Response | None, sigma_mm: float, mode: str) -> Row:
    """All columns of a run, so that every part of the table has the same."""
    settling = (math.nan,) * 3
    if response is not None:
        settling = (response.settling_ms, response.settling_band_ms, response.settling_mean_ms)
    return {
        "peak_mm": math.nan, "settling_ms": settling[0], "settling_band_ms": settling[1],
        "settling_mean_ms": settling[2], "sigma_mm": sigma_mm, "mean_mm": math.nan,
        "fuel_mean_mg": math.nan, "fuel_sigma_mg": math.nan, "contacts": 0, "misfires": 0,
        "forced_misfires": 0, "strokes": 0, "mode": mode,
        "lost": mode not in ("generating", NOT_BEGUN), "note": "",
    }  # fmt: skip
