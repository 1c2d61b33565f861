"""Curves for the report: a window of the motion at full rate, and what changes once a stroke."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.figures import RunData, main_instant
from bench.judge.punctuality import earliest_ns
from bench.judge.strokes import Floats
from bench.run.directory import RunFiles
from hil import log as logs
from hil.log import Log

_BEFORE_S, _AFTER_S = 0.10, 0.45
_START_S = 1.2
_PROFILE_BINS = 400
_MAX_STEPS = 20_000


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
    """What the pictures show; `strokes` are the rows of /stroke."""

    window_s: tuple[float, float]
    t_s: Floats
    x_m: Floats
    v_m_s: Floats
    load: Steps
    strokes: NDArray[Any]
    lateness: dict[str, Profile]


def window_of(data: RunData) -> tuple[float, float]:
    """Choose the part of the run that is shown at full rate: about its event."""
    end_s = data.truth.end_ns * 1e-9
    instant = main_instant(data)
    if data.scenario.begins == "at-rest":
        begin = next((i.t_ns for i in data.instants if i.t_ns is not None), 0) * 1e-9
        return max(begin - _BEFORE_S, 0.0), min(begin + _START_S, end_s)
    middle = _BEFORE_S if instant is None else (instant.t_ns or 0) * 1e-9
    return max(middle - _BEFORE_S, 0.0), min(middle + _AFTER_S, end_s)


def read_traces(data: RunData, files: RunFiles) -> Traces:
    """Gather the curves in one pass over each log."""
    window = window_of(data)
    with logs.open(files.plant_log) as plant, logs.open(files.controller_log) as controller:
        rows, load = _read_truth(plant, window)
        lateness = {}
        if data.scenario.loop.clock == "realtime":
            lateness = {
                "plant": _read_lateness(plant, sample_driven=False),
                "controller": _read_lateness(controller, sample_driven=True),
            }
        strokes = controller.array("/stroke")
    t_s = rows["t_ns"] * 1e-9
    return Traces(window, t_s, rows["x_m"], rows["v_m_s"], load, strokes, lateness)


def _read_truth(plant: Log, window: tuple[float, float]) -> tuple[NDArray[Any], Steps]:
    """Return the rows inside the window, and every change of the load."""
    low, high = round(window[0] * 1e9), round(window[1] * 1e9)
    rows: list[NDArray[Any]] = []
    changes: list[Floats] = []
    last, end_s = np.nan, 0.0
    for block in plant.blocks("/truth"):
        t_ns = block["t_ns"]
        rows.append(block[(t_ns >= low) & (t_ns <= high)])
        value = block["load_coefficient_n_s_m"]
        new = np.diff(value, prepend=last) != 0.0
        if len(changes) < _MAX_STEPS:
            changes.append(np.stack([t_ns[new] * 1e-9, value[new]]))
        last = value[-1]
        end_s = t_ns[-1] * 1e-9
    t_s, values = np.concatenate(changes, axis=1)
    return np.concatenate(rows), Steps(np.append(t_s, end_s), np.append(values, last))


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
