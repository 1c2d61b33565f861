"""Curves for the report: signals with their windows at full rate, and what changes seldom."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.figures import RunData, main_instant
from bench.judge.punctuality import earliest_ns
from bench.judge.strokes import Floats
from bench.report.curves.envelope import Trace, Window, gather, merged
from bench.report.curves.lines import Pulse, Stretch, machine_modes, operating_modes, read_pulses
from bench.run.directory import RunFiles
from hil import log as logs
from hil.log import Log

_BEFORE_S, _AFTER_S = 0.10, 0.45
_START_S = 1.2
_PROFILE_BINS = 400
_MAX_STEPS = 20_000

TRUTH = ("x_m", "v_m_s")
SENSED = ("p_left_pa", "p_right_pa", "electric_power_w")
ORDERED = ("force_n", "throttle")


class Steps(NamedTuple):
    """A quantity that holds between its changes."""

    t_s: Floats
    value: Floats


class Profile(NamedTuple):
    """Lateness over the run: largest and mean of each bin [us]."""

    t_s: Floats
    max_us: Floats
    mean_us: Floats


class Traces(NamedTuple):
    """What the pictures show; `strokes` are the rows of /stroke, `signals` has TRUTH and so on."""

    window_s: tuple[float, float]
    end_s: float
    signals: dict[str, Trace]
    load: Steps
    strokes: NDArray[Any]
    pulses: list[Pulse]
    operating: list[Stretch]
    machine: list[Stretch]
    lateness: dict[str, Profile]

    def within(self, name: str, window_s: tuple[float, float]) -> tuple[Floats, Floats]:
        """Return times and values of a signal in a window that is there at full rate."""
        t_s, y = self.signals[name].t_s, self.signals[name].y
        shown = (t_s >= window_s[0]) & (t_s <= window_s[1]) & np.isfinite(y)
        return t_s[shown], y[shown]


def window_of(data: RunData) -> tuple[float, float]:
    """Choose the part of the run that the overview shows: about its event."""
    end_s = data.truth.end_ns * 1e-9
    instant = main_instant(data)
    if data.scenario.begins == "at-rest":
        begin = next((i.t_ns for i in data.instants if i.t_ns is not None), 0) * 1e-9
        return max(begin - _BEFORE_S, 0.0), min(begin + _START_S, end_s)
    middle = _BEFORE_S if instant is None else (instant.t_ns or 0) * 1e-9
    return max(middle - _BEFORE_S, 0.0), min(middle + _AFTER_S, end_s)


def _wanted(data: RunData, end_ns: int) -> Iterator[Window]:
    """Windows at full rate, the most important first: events, what went wrong, both ends."""

    def about(t_ns: int) -> Window:
        return t_ns - round(_BEFORE_S * 1e9), t_ns + round(_AFTER_S * 1e9)

    low_s, high_s = window_of(data)
    yield round(low_s * 1e9), round(high_s * 1e9)
    yield from (about(i.t_ns) for i in data.instants if i.t_ns is not None)
    last = -1
    for line in data.happenings.lines:
        notable = line.severity != "info" or line.code.startswith(("mode ", "misfire"))
        if notable and line.t_ns > last:
            yield about(line.t_ns)
            last = line.t_ns + round(_AFTER_S * 1e9)
    yield about(0)
    yield about(end_ns)


def read_traces(data: RunData, files: RunFiles) -> Traces:
    """Gather the curves in one pass over each log and topic."""
    with logs.open(files.plant_log) as plant, logs.open(files.controller_log) as controller:
        end_ns = max(plant.end_ns, 1)
        windows = merged(_wanted(data, end_ns), end_ns, data.scenario.loop.period_ns)
        signals = gather(plant, "/truth", TRUTH, windows)
        signals |= gather(plant, "/sensor", SENSED, windows)
        signals |= gather(plant, "/actuator", ORDERED, windows)
        lateness = {}
        if data.scenario.loop.clock == "realtime":
            lateness = {
                "plant": _read_lateness(plant, sample_driven=False),
                "controller": _read_lateness(controller, sample_driven=True),
            }
        return Traces(
            window_of(data),
            end_ns * 1e-9,
            signals,
            _read_load(plant),
            controller.array("/stroke"),
            read_pulses(plant, windows) if "/actuator" in plant.topics else [],
            operating_modes(data.first_mode, data.happenings, end_ns * 1e-9),
            machine_modes(plant, end_ns * 1e-9) if "/actuator" in plant.topics else [],
            lateness,
        )


def _read_load(plant: Log) -> Steps:
    """Return every change of the load."""
    changes: list[Floats] = []
    last, end_s = np.nan, 0.0
    for block in plant.blocks("/truth"):
        value = block["load_coefficient_n_s_m"]
        new = np.diff(value, prepend=last) != 0.0
        if len(changes) < _MAX_STEPS:
            changes.append(np.stack([block["t_ns"][new] * 1e-9, value[new]]))
        last, end_s = value[-1], block["t_ns"][-1] * 1e-9
    t_s, values = np.concatenate(changes, axis=1)
    return Steps(np.append(t_s, end_s), np.append(values, last))


def _read_lateness(log: Log, *, sample_driven: bool) -> Profile:
    """Return the lateness over the run in a fixed number of bins."""
    count = max(log.topics["/timing"].messages, 1)
    end_ns = max(log.end_ns, 1)
    bins = min(_PROFILE_BINS, count)
    largest, total, number = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    origin_ns = earliest_ns(log) if sample_driven else 0
    for block in log.blocks("/timing"):
        run = block[block["missed"] == 0]
        place = np.minimum(run["t_ns"] * bins // (end_ns + 1), bins - 1).astype(np.int64)
        late = np.maximum((run["woke_ns"] - run["scheduled_ns"] - origin_ns) * 1e-3, 0.0)
        np.maximum.at(largest, place, late)
        total += np.bincount(place, weights=late, minlength=bins)
        number += np.bincount(place, minlength=bins)
    centres = (np.arange(bins) + 0.5) * end_ns * 1e-9 / bins
    filled = number > 0
    return Profile(centres[filled], largest[filled], (total[filled] / number[filled]))
