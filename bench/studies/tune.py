"""Finding the gains of the piston-motion laws, and judging those in force.

    hil tune cascade             judge the gains of the default configuration
    hil tune cascade --search    look for better ones

One set of gains for all steps of a trial, by default on both linear models, and as a constraint
for engines that the controller does not believe (docs/tuning.md).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from bench.judge.response import Response
from bench.progress import Advance, progress, unseen
from bench.run.scenarios import find
from bench.studies.pool import worker_pool
from bench.studies.trial import Cell, Trial, judge, scenario_of
from controller.motion.laws import LAWS
from controller.motion.own import own_settings, own_source
from hil.brought import LAWS as LAWS_GROUP
from hil.brought import is_brought, name_of
from hil.config.controller import ControllerConfig
from hil.config.load import build, with_override
from hil.errors import ConfigError
from hil.files import Output
from hil.nearest import did_you_mean
from hil.toml import read_toml

LATE_S = 0.14
"""From here on after the step an error counts against the margin in the band."""

FEWEST_STROKES = 10
UNSETTLED = 1e6
ROBUST_MM = 0.4
"""Largest late error that the constraint allows with another engine than was believed."""

Gains = dict[str, float]


TUNABLE = {name: law.parameters for name, law in LAWS.items() if law.parameters}
"""Every law that has something to tune, with the keys of its gains below `controller.`."""


def keys_of(law: str) -> tuple[str, ...]:
    """Return the keys of a law's gains; of a user's own they are the numbers of its Settings.

    Raises: ConfigError for a law without gains
    """
    if law in TUNABLE:
        return TUNABLE[law]
    if not is_brought(LAWS_GROUP, law):
        raise ConfigError(
            f"tune {law!r}: accepted are {', '.join(TUNABLE)}, or a file ending in .py"
            f"{did_you_mean(law, TUNABLE)}"
        )
    keys = tuple(f"own.settings.{key}" for key in _own_gains(law))
    if not keys:
        raise ConfigError(f"tune {law}: its Settings declares no number")
    return keys


def _own_gains(law: str) -> Gains:
    """The numbers of the Settings of a user's own law, as they are unless set otherwise."""
    config = ControllerConfig(name=law)
    source = own_source(config)
    settings = None if source is None else own_settings(source[0], config, source[1])
    given = {} if settings is None else settings.model_dump()
    return {key: value for key, value in given.items() if isinstance(value, float)}


Judge = Callable[[str, Gains, Sequence[Cell]], list[Response]]
"""Runs a law with its gains on every cell."""


def judge_all(law: str, gains: Gains, cells: Sequence[Cell]) -> list[Response]:
    """Run every cell, one after the other."""
    return [judge(cell, law, gains) for cell in cells]


@contextlib.contextmanager
def judge_with(workers: int) -> Iterator[Judge]:
    """Run the cells in several processes; the figures are the same."""
    with worker_pool(workers) as pool:

        def shared(law: str, gains: Gains, cells: Sequence[Cell]) -> list[Response]:
            return list(pool.map(partial(judge, law=law, gains=gains), cells))

        yield shared


def cost(trial: Trial, found: Sequence[Response]) -> float:
    """Worst cell's largest error late after the step, and a little of all squared errors.

    A set that is fine in seven cells and slow in one is not fine; the squares keep the search
    from paying for the last micrometre with a large overshoot. The constraint: with another engine
    than is believed no late error beyond `ROBUST_MM`; what is beyond counts ten times.
    """
    results, others = found[: len(trial.cells)], found[len(trial.cells) :]
    if any(len(result.errors_mm) < FEWEST_STROKES for result in found):
        return UNSETTLED
    squares = sum(min(abs(e), 5.0) ** 2 for result in results for e in result.errors_mm)
    beyond = max(max(result.peak_after_mm(LATE_S) for result in others) - ROBUST_MM, 0.0)
    return max(result.peak_after_mm(LATE_S) for result in results) + 1e-3 * squares + 10.0 * beyond


def looked_for(
    law: str, start: Gains, generations: int, trial: Trial, judged: Judge = judge_all,
    advance: Advance = unseen,
) -> Gains:  # fmt: skip
    """Differential evolution, seeded, within a factor of two about the gains in force."""
    from scipy.optimize import differential_evolution

    keys = keys_of(law)
    x0 = [start[key] for key in keys]

    def cost_with(vector: Sequence[float]) -> float:
        gains = dict(zip(keys, map(float, vector), strict=True))
        return cost(trial, judged(law, gains, trial.every))

    bounds = [sorted((0.5 * gain, min(2.0 * gain, 1.0) if law == "machine" and gain > 0.1
                      else 2.0 * gain)) for gain in x0]  # fmt: skip
    found = differential_evolution(
        cost_with, bounds, x0=x0, maxiter=generations, popsize=6, rng=1, polish=False,
        callback=lambda _x, convergence: advance(1),
    )  # fmt: skip
    return dict(zip(keys, map(float, found.x), strict=True))


def gains_in_force(law: str) -> Gains:
    """The gains of the default configuration."""
    if law not in TUNABLE:
        return {f"own.settings.{key}": value for key, value in _own_gains(law).items()}
    found = {}
    for key in TUNABLE[law]:
        value: Any = ControllerConfig()
        for part in key.split("."):
            value = getattr(value, part)
        found[key] = float(value)
    return found


def table(law: str, gains: Gains, trial: Trial, found: Sequence[Response]) -> str:
    """Peak and settling of every cell, the cells of the constraint last."""
    lines = [f"{law}: " + ", ".join(f"{key} = {value:.4g}" for key, value in gains.items())]
    for cell, result in zip(trial.every, found, strict=True):
        lines.append(
            f"  {cell}: peak {result.peak_mm:.3f} mm, {_settling(result)},"
            f" at most {result.peak_after_mm(LATE_S):.3f} mm after {1e3 * LATE_S:.0f} ms"
        )
    return "\n".join(lines)


def _settling(result: Response) -> str:
    ms = result.settling_ms
    return f"settles in {ms:.0f} ms" if math.isfinite(ms) else "does not settle"


class Wanted(NamedTuple):
    """What is asked for; `generations`: of a search, none to judge only."""

    law: str
    trial: Trial
    generations: int = 0
    start: str | None = None
    out: Path | None = None
    force: bool = False
    workers: int = 2


def run(wanted: Wanted) -> int:
    """Judge, search where asked, say what it bought, write gains and provenance.

    Raises: ConfigError for a law without gains, or gains that cannot be read
    """
    law, trial = wanted.law, wanted.trial
    keys_of(law)
    file = None if wanted.out is None else Output("--out", wanted.out, wanted.force)
    if file is not None:
        file.check(".toml")
    before = gains_in_force(law)
    gains = _read_gains(law, wanted.start) if wanted.start else before
    for cell in trial.cells:
        if (cell.load, cell.fraction) == trial.cells[0][1:3]:
            scenario_of(cell, law, gains)  # refused before any work
    with judge_with(wanted.workers) as judged:
        if wanted.generations:
            with progress(f"tune {law}", wanted.generations, "generations") as advance:
                gains = looked_for(law, gains, wanted.generations, trial, judged, advance)
        found = judged(law, gains, trial.every)
        were = found if gains == before else judged(law, before, trial.every)
    print(table(law, gains, trial, found))
    costs = cost(trial, were), cost(trial, found)
    print(f"cost {costs[1]:.4f}; with the gains in force {costs[0]:.4f}")
    if file is not None:
        _write(wanted, gains, costs, file)
        print(f"{wanted.out}: hil run {wanted.out}")
    return 0


def _read_gains(law: str, text: str) -> Gains:
    """Gains in the order of the law's keys."""
    keys = keys_of(law)
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != len(keys):
        raise ConfigError(f"--from {text!r}: accepted are the numbers of {', '.join(keys)}")
    return dict(zip(keys, values, strict=True))


def _write(wanted: Wanted, gains: Gains, costs: tuple[float, ...], file: Output) -> None:
    """Write a scenario that runs with the gains, and says where they are from."""
    from bench.studies.campaign.table import to_toml

    law, first = wanted.law, wanted.trial.cells[0]
    settings: dict[str, Any] = {
        "name": f"tuned-{name_of(law)}", "controller.name": law,
        "plant.prototype": first.prototype, "plant.model": first.model,
        "loop.rate_hz": first.rate_hz,
        **{f"controller.{key}": value for key, value in gains.items()},
    }  # fmt: skip
    settings["controller.tuning"] = {
        "law": name_of(law), "objective": " ".join((cost.__doc__ or "").split()),
        "cells": list(map(str, wanted.trial.every)),
        "method": f"differential evolution, {wanted.generations} generations, seed 1"
        if wanted.generations else "judged only",
        "cost": costs[1], "cost_before": costs[0],
    }  # fmt: skip
    tree = read_toml(find("load-decrease"))
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    build(tree, str(file.path))
    file.write(to_toml(tree))
