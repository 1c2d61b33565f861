"""The load steps by which gains are judged: engines, rates, and engines that are not believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from bench.judge.response import Response
from bench.run.offline import Course, simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from hil.config.engine.models import DETAILED_MODELS
from hil.config.load import build, with_override
from hil.config.resolved import Resolved
from hil.errors import ConfigError
from hil.toml import read_toml

MODELS: Final = ("harmonic", "rectangular")
LOADS: Final = (0.85, 1.15)
FRACTIONS: Final = (0.25, 0.75)
NOMINAL_HZ: Final = 1000

EVENT_S: Final = 0.1
DURATION_S: Final = 0.75
LEARNT_S: Final = 1.0
"""So long an engine that is not believed runs before the step."""

OTHER_FIGURES: Final = (
    ("engine.moving_mass_kg", 0.9), ("engine.moving_mass_kg", 1.1),
    ("engine.heating_value_j_kg", 0.9), ("engine.heating_value_j_kg", 1.1),
)  # fmt: skip
OTHER_FLOWS: Final = (
    ("injector.flow_scale_left", 0.95), ("injector.flow_scale_left", 1.05),
    ("injector.flow_scale_right", 0.95), ("injector.flow_scale_right", 1.05),
)  # fmt: skip
"""Keys of the plant with their ratio to what is believed; a detailed engine is its own figures."""


class Cell(NamedTuple):
    """One load step on one engine; `other`: what of the plant differs from what is believed."""

    model: str
    load: float
    fraction: float
    other: tuple[tuple[str, float], ...] = ()
    rate_hz: int = NOMINAL_HZ
    prototype: str = "nu"

    def __str__(self) -> str:
        engine = self.model if self.prototype == "nu" else f"{self.prototype} {self.model}"
        rate = "" if self.rate_hz == NOMINAL_HZ else f", {self.rate_hz} Hz"
        other = "".join(f", {100 * (r - 1):+.0f} % {key}" for key, r in self.other)
        return f"{engine:<11} {100 * (self.load - 1):+3.0f} % at {self.fraction:g}{rate}{other}"


class Trial(NamedTuple):
    """What a set of gains is judged by: steps, and steps on engines that are not believed."""

    cells: tuple[Cell, ...]
    others: tuple[Cell, ...]

    @property
    def every(self) -> tuple[Cell, ...]:
        """All steps, those on engines that are not believed last."""
        return (*self.cells, *self.others)


def trial_of(
    models: Sequence[str] = (), rates: Sequence[int] = (NOMINAL_HZ,), prototype: str = "nu"
) -> Trial:
    """Return the steps on every model at every rate; those not believed on each, at the first.

    Parameters: models : names or files; without any both linear ones, and harmonic not believed
    """
    cells = tuple(
        Cell(model, load, part, rate_hz=rate, prototype=prototype)
        for model in models or MODELS for rate in rates for load in LOADS for part in FRACTIONS
    )  # fmt: skip
    others = tuple(
        Cell(model, LOADS[0], FRACTIONS[1], (change,), rates[0], prototype)
        for model in models or MODELS[:1]
        for change in (OTHER_FLOWS if model in DETAILED_MODELS else OTHER_FIGURES)
    )
    return Trial(cells, others)


def read_trial(models: str | None, rates: str, prototype: str) -> Trial:
    """Return the steps on models and at rates separated by commas, on an engine or a file of one.

    Raises: ConfigError for a rate that is no number, or a cell that cannot be
    """
    names = [] if models is None else [name.strip() for name in models.split(",")]
    try:
        numbers = [int(word) for word in rates.split(",")]
    except ValueError:
        raise ConfigError(f"--rate {rates!r}: accepted are whole numbers, as 500,1000") from None
    trial = trial_of(names, numbers, prototype)
    for cell in trial.cells:
        build(tree_of(cell, "cascade", {}), " ".join(f"tune {cell}".split()))
    return trial


def tree_of(cell: Cell, law: str, gains: dict[str, float]) -> dict[str, Any]:
    """The load-decrease scenario for a cell, with the event early and the law's gains set."""
    tree = read_toml(find("load-decrease"))
    settings: dict[str, Any] = {
        "plant.prototype": cell.prototype, "plant.model": cell.model, "controller.name": law,
        "loop.rate_hz": cell.rate_hz, "loop.clock": "lockstep",
    }  # fmt: skip
    if cell.other:
        believed = build(_with(tree, settings), str(cell))
        settings |= _mistaken(cell, resolve(believed))
    begins_s = LEARNT_S if cell.other else EVENT_S
    settings |= {
        "run.duration_s": begins_s + DURATION_S,
        "events.load.value": cell.load, "events.load.at_s": begins_s,
        "events.load.at_stroke_fraction": cell.fraction,
        **{f"controller.{key}": value for key, value in gains.items()},
    }  # fmt: skip
    return _with(tree, settings)


def _with(tree: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    return tree


def _mistaken(cell: Cell, believed: Resolved) -> dict[str, Any]:
    """The controller keeps to what it believes; the plant is another."""
    settings: dict[str, Any] = {"controller.preset": believed.controller.preset.model_dump()}
    parts = {"engine": believed.plant.believed(), "injector": believed.plant.injector}
    for key, ratio in cell.other:
        part, name = key.split(".")
        settings[f"plant.{key}"] = ratio * getattr(parts[part], name)
    return settings


def scenario_of(cell: Cell, law: str, gains: dict[str, float]) -> Resolved:
    """The resolved scenario of a cell."""
    return resolve(build(tree_of(cell, law, gains), str(cell)))


def judge(cell: Cell, law: str, gains: dict[str, float]) -> Response:
    """Run one cell."""
    scenario = scenario_of(cell, law, gains)
    return read_off(fired(scenario, simulate(scenario)), scenario.controller.tdc_ref_m)


def fired(scenario: Resolved, course: Course) -> Course:
    """Leave out the dead centres at which by the engine's cycle nothing burns."""
    if all(scenario.controller.timing.fires):
        return course
    return course._replace(dead_centres=[dc for dc in course.dead_centres if dc.fuel_kg > 0.0])


def read_off(course: Course, tdc_ref_m: float) -> Response:
    """TDC errors from the load step on; none when the engine stopped before it."""
    step_ns = next((e.t_ns for e in course.events if e.code == "disturbance"), math.inf)
    after = [dc for dc in course.dead_centres if dc.t_ns > step_ns]
    return Response(
        tuple((dc.t_ns - step_ns) * 1e-9 for dc in after),
        tuple((abs(dc.x_m) - tdc_ref_m) * 1e3 for dc in after),
    )
