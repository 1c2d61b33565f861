"""Signals over time, from the logs of a run: what expectations are judged by."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from bench.judge.strokes import Floats, Ints, Strokes, read_truth, set_points
from bench.run.checks.signals import DEAD_CENTRE, Source, source_of
from bench.run.directory import opened
from hil import log as logs
from hil.config.resolved import Resolved, read_resolved
from hil.log import Log


class Trace(NamedTuple):
    """A signal over time; both arrays have shape (values,), in order of time.

    t_ns: instants from the start of the run; value: in the unit that the signal's name ends with
    """

    t_ns: Ints
    value: Floats

    def between(self, start_ns: float, end_ns: float) -> Trace:
        """Return the values from one instant to another, both included; none that is nan."""
        chosen = (self.t_ns >= start_ns) & (self.t_ns <= end_ns) & np.isfinite(self.value)
        return Trace(self.t_ns[chosen], self.value[chosen])

    def at(self, t_ns: Ints) -> Floats:
        """Return the value at other instants: between two on their line, beyond the ends as there.

        Shapes: t_ns (n,) -> (n,); nan when it has no value at all
        """
        known = np.isfinite(self.value)
        if not known.any():
            return np.full(len(t_ns), np.nan)
        return np.interp(t_ns, self.t_ns[known], self.value[known])


Traces = Mapping[str, Trace]
NO_TRACES: Final[Traces] = {}


def read_traces(scenario: Resolved, both: Mapping[str, Log], strokes: Strokes) -> dict[str, Trace]:
    """Read every signal that an expectation names, each once."""
    names = {name for expectation in scenario.expect.values() for name in expectation.signals}
    return {name: read_trace(both, strokes, name) for name in sorted(names)}


def read_trace(both: Mapping[str, Log], strokes: Strokes, name: str) -> Trace:
    """Read one signal.

    Raises: LogError when the log has no such topic or field
    """
    signal = source_of(name)
    if signal.side == DEAD_CENTRE:
        return Trace(strokes.t_ns, getattr(strokes, signal.field))
    return _logged(both[signal.side], signal)


def _logged(log: Log, signal: Source) -> Trace:
    times: list[Any] = [np.empty(0, np.int64)]
    values: list[Any] = [np.empty(0)]
    for block in log.blocks(signal.topic):
        times.append(block["t_ns"].astype(np.int64))
        column = block[signal.field]
        values.append((column if signal.item is None else column[:, signal.item]).astype(float))
    return Trace(np.concatenate(times), np.concatenate(values))


def read_recorded(directory: Path, name: str) -> Trace:
    """Read a signal of an earlier run.

    Raises: ConfigError when there is no finished run, LogError when it cannot be read
    """
    files = opened(directory)
    scenario = read_resolved(files.scenario)
    with logs.open(files.plant_log) as plant, logs.open(files.controller_log) as controller:
        truth = read_truth(plant, scenario.controller.tdc_ref_m, set_points(controller))
        return read_trace({"plant": plant, "controller": controller}, truth.strokes, name)
