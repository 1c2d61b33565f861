"""What can be told of a scenario's stimuli before the run: names, ranges, and what is played."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.run.checks.signals import source_of
from controller.live.stimulation import SIGNALS as OF_CONTROLLER
from hil import log as logs
from hil.config.base import value_of
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.config.suite.stimulus import MOST_SAMPLES, Condition, Stimulus
from hil.errors import ConfigError, LogError
from hil.event_codes import OF_BOTH, OF_THE_CONTROLLER, OF_THE_PLANT
from hil.files import read_regular
from hil.names.parameters import parameter_of
from hil.nearest import listed
from hil.stimuli.courses import extremes
from hil.stimuli.records import MOST_PARAMETERS
from plant.stimulation import SIGNALS as OF_PLANT

_SIGNALS: Final[Mapping[str, Mapping[str, Any]]] = {
    "plant": OF_PLANT, "controller": OF_CONTROLLER,
}  # fmt: skip
_CODES: Final = {
    "plant": {**OF_THE_PLANT, **OF_BOTH}, "controller": {**OF_THE_CONTROLLER, **OF_BOTH},
}  # fmt: skip


def loaded(scenario: Scenario) -> Scenario:
    """Return the scenario with what its stimuli play back read from the files.

    Raises: ConfigError naming stimulus and file
    """
    played = {
        name: given.model_copy(update={"samples": _samples(scenario, name, given)})
        for name, given in scenario.stimuli.items()
        if given.kind == "playback" and given.samples is None
    }
    return scenario.model_copy(update={"stimuli": {**scenario.stimuli, **played}})


def check_stimuli(scenario: Resolved) -> None:
    """Refuse a stimulus that could not be followed, or that leaves its parameter's range.

    Raises: ConfigError naming stimulus, key and what is accepted
    """
    for name, given in scenario.stimuli.items():
        where = f"{scenario.name}: events.{name}"
        try:
            if given.kind != "command":
                _check_parameter(scenario, given)
            for key, condition in given.conditions.items():
                _check_condition(scenario, given.side, condition, key)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from None
    for side in _SIGNALS:
        keys = {g.parameter for g in scenario.stimuli.values() if g.parameter and g.side == side}
        if len(keys) > MOST_PARAMETERS:
            raise ConfigError(
                f"{scenario.name}: events: stimuli of {len(keys)} parameters of the {side}; "
                f"accepted are {MOST_PARAMETERS}"
            )


def _check_parameter(scenario: Resolved, given: Stimulus) -> None:
    parameter = parameter_of(given.parameter)
    if not parameter.live or parameter.side == "both":
        raise ConfigError(f"{given.parameter} cannot change while the engine runs")
    base = value_of(scenario, given.parameter)
    if base is None:
        raise ConfigError(f"{given.parameter} has no value; accepted is a stimulus of one that has")
    inner = 0.0 if given.added else float(base)
    for value in extremes(given, inner):
        parameter.checked(value + (float(base) if given.added else 0.0))


def _check_condition(scenario: Resolved, side: str, condition: Condition, key: str) -> None:
    """A side knows its own signals and events only."""
    if condition.signal is not None and condition.signal not in _SIGNALS[side]:
        known = _SIGNALS[side]
        told = f"{condition.signal!r}: accepted here: {listed(condition.signal, known)}"
        raise ConfigError(f"{key}.signal: {told}")
    event = condition.event
    if event is None:
        return
    own = {n for n, e in scenario.events.items() if e.to == side}
    own |= {n for n, s in scenario.stimuli.items() if s.side == side}
    if event not in own and event not in _CODES[side]:
        named = (*sorted(own), *_CODES[side])
        raise ConfigError(f"{key}.event: {event!r} is none of the {side}'s: {listed(event, named)}")


def _samples(scenario: Scenario, name: str, given: Stimulus) -> Any:  # noqa: ANN401
    path = Path(given.file or "")
    read: Callable[[Path, Stimulus], Any] = _of_log if path.suffix == ".mcap" else _of_table
    try:
        times, values = read(path, given)
    except (ConfigError, LogError, OSError) as error:
        raise ConfigError(f"{scenario.name}: events.{name}.file: {error}") from None
    if not 1 <= len(times) <= MOST_SAMPLES or not (np.isfinite(times) & np.isfinite(values)).all():
        told = (
            f"{path}: {len(times)} samples; accepted are 1 to {MOST_SAMPLES}, all of them numbers"
        )
        raise ConfigError(f"{scenario.name}: events.{name}.file: {told}")
    if (np.diff(times) <= 0.0).any():
        raise ConfigError(f"{scenario.name}: events.{name}.file: {path}: times must increase")
    return tuple((times - times[0]).tolist()), tuple(values.tolist())


def _of_log(path: Path, given: Stimulus) -> tuple[Any, Any]:
    """A column of a log, by the name of the signal; of any log by topic and field."""
    column = given.column or ""
    side, _, rest = column.partition(".")
    topic, field = f"/{rest.rpartition('.')[0].replace('.', '/')}", rest.rpartition(".")[2]
    if side not in ("plant", "controller"):
        topic, field = f"/{column.rpartition('.')[0].strip('/')}", column.rpartition(".")[2]
    else:
        source_of(column)
    with logs.open(path) as log:
        frame = log.array(topic)
        names = [f.name for f in log.topics[topic].fields]
        if field not in names:
            raise ConfigError(f"{path}: {topic} has no {field}; it has: {listed(field, names)}")
        times = frame["t_ns"] * 1e-9
        return times, frame[field].astype(float)


def _of_table(path: Path, given: Stimulus) -> tuple[Any, Any]:
    """A column of a CSV file, and that of its times: the first one, unless it is named."""
    text = read_regular(path).decode("utf-8-sig")
    head, *rows = [row for row in csv.reader(text.splitlines()) if row]
    head = [name.strip() for name in head]
    times = given.times or head[0]
    others = [name for name in head if name != times]
    column = given.column or (others[0] if len(others) == 1 else "")
    for name in (times, column):
        if name not in head:
            raise ConfigError(f"{path}: no column {name!r}; it has: {listed(name, head)}")
    at, of = head.index(times), head.index(column)
    try:
        return np.array([float(r[at]) for r in rows]), np.array([float(r[of]) for r in rows])
    except (ValueError, IndexError):
        raise ConfigError(f"{path}: a row has no numbers under {times} and {column}") from None
