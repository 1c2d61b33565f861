"""Figures of a run, from its two logs in numpy blocks; the memory needed is that of the strokes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from bench.judge.cause import NO_TRACE, Trace, read_trace
from bench.judge.energy import Electric, Indicated, read_electric, read_indicated
from bench.judge.events import Happenings, Instant, instants, read_happenings
from bench.judge.punctuality import (
    QUANTILES,
    TickTiming,
    age_quantile,
    answered_share,
    read_timing,
)
from bench.judge.response import BAND_MM, response, settled_after_s
from bench.judge.strokes import (
    Strokes,
    Truth,
    frequency_hz,
    read_truth,
    set_points,
    whole_cycles,
)
from bench.judge.traces import NO_TRACES, Traces, read_traces
from bench.run.directory import RunFiles
from controller.build import initial_mode
from controller.loop import LoopMemory
from hil import log as logs
from hil import snapshot
from hil.config.resolved import Resolved
from hil.log import Log
from hil.values import NEVER
from hil.wire.commands import CONTROLLER

_FINAL_STROKES = 10

Figures = dict[str, Any]

_J_PER_KWH = 3.6e6


class RunData(NamedTuple):
    """What is kept of a run's logs.

    recorders: what those of plant and controller say of a log that is not whole
    traces: the signals that expectations name; first_mode: what the controller was in before
        the first change that it tells
    """

    scenario: Resolved
    truth: Truth
    timing: dict[str, TickTiming]
    happenings: Happenings
    instants: tuple[Instant, ...]
    electric: Electric
    indicated: Indicated
    first_mode: str
    trace: Trace = NO_TRACE
    recorders: Mapping[str, Mapping[str, str]] = MappingProxyType({})
    traces: Traces = NO_TRACES

    @property
    def strokes(self) -> Strokes:
        """Every dead centre of the run."""
        strokes, fires = self.truth.strokes, self.scenario.controller.timing.fires
        if all(fires) or not any(fires):
            return strokes
        return strokes.part(np.resize(np.array(fires), len(strokes.t_ns)))

    @property
    def mode(self) -> str:
        """The operating mode at the end."""
        return self.mode_at(NEVER)

    def mode_at(self, t_ns: int) -> str:
        """Return the operating mode at an instant, from the controller's reports of its changes."""
        changes = (
            line.code.removeprefix("mode ")
            for line in reversed(self.happenings.lines)
            if line.source == "controller" and line.code.startswith("mode ") and line.t_ns <= t_ns
        )
        return next(changes, self.first_mode)

    def instant_ns(self, name: str | None) -> int | None:
        """Return when a named event first happened, 0 without a name, None when it did not."""
        return 0 if name is None else next(iter(self.occurrences(name)), None)

    def occurrences(self, name: str) -> Sequence[int]:
        """Return all instants [ns] of an event of the scenario, or of a code of the logs."""
        if name in self.scenario.stimuli:
            return self.happenings.beginnings(name)
        if name in self.scenario.events:
            return [i.t_ns for i in self.instants if i.name == name and i.t_ns is not None]
        return self.happenings.times_ns.get(name, [])


def read_run(scenario: Resolved, files: RunFiles) -> RunData:
    """Read both logs once.

    Raises: LogError when one of them cannot be read
    """
    with logs.open(files.plant_log) as plant, logs.open(files.controller_log) as controller:
        both = {"plant": plant, "controller": controller}
        happenings = read_happenings(both)
        first_m = scenario.controller.tdc_ref_m or 0.0
        truth = read_truth(plant, first_m, set_points(controller))
        return RunData(
            scenario,
            truth,
            {
                "plant": read_timing(plant),
                "controller": read_timing(controller, sample_driven=True),
            },
            happenings,
            instants(scenario, happenings),
            read_electric(plant, scenario, truth.strokes, truth.ticks / scenario.loop.rate_hz),
            read_indicated(plant, scenario, truth.strokes),
            _first_mode(scenario, controller),
            read_trace(scenario, happenings, both),
            {name: told for name, log in both.items()
             if "missing" in (told := log.metadata.get("recorder", {}))},
            read_traces(scenario, both, truth.strokes),
        )  # fmt: skip


def _first_mode(scenario: Resolved, log: Log) -> str:
    """Return the operating mode that a log begins in."""
    mode = initial_mode(scenario.controller)
    if log.continues and (first := next(log.records("/snapshot"), None)) is not None:
        mode = snapshot.loads(LoopMemory, first.state).state.mode
    return mode.name.lower()


def figures(data: RunData, wall_s: float | None) -> Figures:
    """Return all figures of a run, flat, units in the names; what has no value is None.

    Parameters: wall_s : what the loop took, None when it is not known [s]
    """
    simulated_s = data.truth.ticks / data.scenario.loop.rate_hz
    motion = _motion(data)
    return {
        **motion,
        **_after_main_event(data),
        **_consumption(data),
        "electric_energy_j": data.electric.energy_j,
        "electric_power_mean_w": data.electric.power_w,
        "terminal_power_mean_w": data.electric.terminal_w,
        "misfires": data.happenings.counts.get("misfire", 0),
        "contacts": data.truth.contacts,
        "last_speed_m_s": data.truth.last_speed_m_s,
        "mode_final": data.mode,
        "simulated_s": simulated_s,
        "wall_s": wall_s,
        "speed_sim_s_per_wall_s": _ratio(simulated_s, wall_s),
        **_ticks(data),
    }


def _consumption(data: RunData) -> Figures:
    """Figures of the gas's work, and what fuel it and the electric energy took."""
    found, brake = data.indicated, data.electric.brake_fuel_kg_j
    fuel, mean = found.fuel_kg_j, found.mean_pa
    return {
        "imep_bar": None if mean is None else mean * 1e-5,
        "indicated_power_mean_w": found.power_w,
        "indicated_fuel_kg_kwh": None if fuel is None else fuel * _J_PER_KWH,
        "brake_fuel_kg_kwh": None if brake is None else brake * _J_PER_KWH,
    }


def _ratio(a: float, b: float | None) -> float | None:
    return a / b if b else None


def _motion(data: RunData) -> Figures:
    """Figures of the strokes as such."""
    strokes = data.strokes
    count = len(strokes.t_ns)
    tdc_mm = strokes.tdc_m * 1e3
    fuel_mg = strokes.fuel_kg * 1e6
    every, length = data.truth.strokes, len(data.scenario.controller.timing.fires)
    return {
        "strokes": len(every.t_ns),
        "frequency_mean_hz": frequency_hz(whole_cycles(every, length)),
        "frequency_final_hz": frequency_hz(whole_cycles(every, length, _FINAL_STROKES)),
        "tdc_mean_mm": float(tdc_mm.mean()) if count else None,
        "tdc_sigma_mm": float(tdc_mm.std(ddof=1)) if count > 1 else None,
        "tdc_min_mm": float(tdc_mm.min()) if count else None,
        "tdc_max_mm": float(tdc_mm.max()) if count else None,
        "tdc_final_mm": float(tdc_mm[-1]) if count else None,
        "tdc_error_final_mm": float(strokes.error_m[-1] * 1e3) if count else None,
        "fuel_mean_mg": float(fuel_mg.mean()) if count else None,
        "fuel_final_mg": float(fuel_mg[-1]) if count else None,
        "fuel_total_mg": float(fuel_mg.sum()),
    }


def _after_main_event(data: RunData) -> Figures:
    """Peak and settling after the event that matters, or of the whole run without one."""
    instant = main_instant(data)
    return after(data.strokes, 0 if instant is None else instant.t_ns or 0)


def main_instant(data: RunData) -> Instant | None:
    """Return the event that the run is about: the first that an expectation names, or the first."""
    named = [e.event for e in data.scenario.expect.values() if e.event is not None]
    acted = [i for i in data.instants if i.t_ns is not None]
    chosen = [i for i in acted if i.name in named]
    disturbing = [i for i in acted if not _is_operators(data.scenario, i.name)]
    return next(iter(chosen or disturbing or acted), None)


def _is_operators(scenario: Resolved, name: str) -> bool:
    return name in scenario.events and scenario.events[name].to == CONTROLLER


def after(strokes: Strokes, event_ns: int) -> Figures:
    """Peak TDC error and settling time from an instant on."""
    found = response(strokes, event_ns)
    return {
        "tdc_error_peak_mm": found.peak_mm if found.errors_mm else None,
        "settling_s": settled_after_s(found),
        "settling_band_mm": BAND_MM,
    }


def event_figures(data: RunData) -> list[Figures]:
    """Return peak and settling after each event of the scenario."""
    rows = []
    for instant in data.instants:
        row: Figures = {"name": instant.name, "kind": instant.kind, "t_s": None}
        row["refused"] = instant.refused or None
        if instant.t_ns is not None:
            row["t_s"] = instant.t_ns * 1e-9
            row |= after(data.strokes, instant.t_ns)
        rows.append(row)
    return rows


def _ticks(data: RunData) -> Figures:
    """Figures of the ticks; lateness has a meaning in real time only."""
    found: Figures = {}
    real_time = data.scenario.loop.clock == "realtime"
    for name, timing in data.timing.items():
        found[f"{name}_ticks"] = timing.ticks
        found[f"{name}_missed_ticks"] = timing.missed
        for label, histogram in (("late", timing.late), ("work", timing.work)):
            for key, share in QUANTILES.items():
                value = histogram.quantile_ns(share) if real_time else None
                found[f"{name}_{label}_{key}_us"] = None if value is None else value * 1e-3
            found[f"{name}_{label}_max_us"] = histogram.max_ns * 1e-3 if real_time else None
    plant = data.timing["plant"]
    used = plant.ages
    found["answered_next_tick_share"] = answered_share(plant)
    found["sample_age_p50_ticks"] = age_quantile(used, 0.5)
    found["sample_age_p99_ticks"] = age_quantile(used, 0.99)
    found["sample_age_max_ticks"] = int(np.flatnonzero(used)[-1]) if used.any() else None
    return found
