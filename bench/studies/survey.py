"""Every law on every engine: load steps beside the bound, and scatter under combustion noise.

What a row says is the worst of its load steps. `hil compare --quick` takes two moments of the
stroke at 1 kHz, `hil compare --all` six moments and every rate.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, NamedTuple, get_args

from bench.judge.response import Response
from bench.run import scenarios
from bench.run.offline import Course, simulate
from bench.run.resolve import resolve
from bench.studies.bound import Informed
from bench.studies.compare import NO_CONTROL, Tree, bound_of, least_sigma_mm
from bench.studies.pool import worker_pool
from bench.studies.trial import fired
from controller.motion.choice import watches
from controller.motion.laws import LAWS
from hil.config.load import build, with_override
from hil.config.resolved import Resolved
from hil.errors import ConfigError
from hil.toml import read_toml

LOADS: Final = (0.85, 1.15)
RATES: Final = (500, 1000, 2000, 5000, 10000, 20000)
NOMINAL_HZ: Final = 1000
BEFORE_S, AFTER_S, TO_SETTLE_S = 0.2, 0.6, 1.0
EFFICIENCY: Final = (0.95, 1.0)
"""Of a combustion, drawn anew for each: what the scatter is measured under."""


class EngineModel(NamedTuple):
    """An engine and a model of it."""

    prototype: str
    model: str

    @property
    def usual_law(self) -> str:
        """A law that this engine runs with."""
        return "cycle" if self.model == "four-stroke" else "cascade"

    def __str__(self) -> str:
        return f"{self.prototype} {self.model}"


ENGINES: Final = (
    EngineModel("nu", "harmonic"), EngineModel("nu", "rectangular"), EngineModel("nu", "nonlinear"),
    EngineModel("nu", "two-stroke"), EngineModel("nu", "four-stroke"),
    EngineModel("bit", "harmonic"),
)  # fmt: skip


SLOW: Final = ("two-stroke", "four-stroke", "nonlinear")


class Extent(NamedTuple):
    """How much of it is run: fractions of a stroke, rates, seconds of combustion noise."""

    fractions: tuple[float, ...]
    rates: tuple[int, ...]
    noise_s: float


QUICK: Final = Extent((0.25, 0.75), (NOMINAL_HZ,), 6.0)
WHOLE: Final = Extent((0.05, 0.25, 0.432, 0.6, 0.75, 0.9), RATES, 20.0)


class Row(NamedTuple):
    """What a law does on an engine at a rate; None stands for never, and for what there is not.

    bound_mm, bound_ms: of what the law can know, on the same steps; sigma_least_mm: of any law
    lost: runs that did not end generating, or with contact; note: why there are no figures
    """

    law: str
    engine: str
    model: str
    rate_hz: int
    peak_mm: float | None = None
    settling_ms: float | None = None
    bound_mm: float | None = None
    bound_ms: float | None = None
    sigma_mm: float | None = None
    sigma_least_mm: float | None = None
    lost: int = 0
    misfires: int = 0
    note: str = ""


class Task(NamedTuple):
    """One row to be filled in."""

    law: str
    engine: EngineModel
    rate_hz: int
    extent: Extent
    changes: tuple[tuple[str, Any], ...]


def tasks(
    laws: Sequence[str], engines: Sequence[EngineModel], extent: Extent,
    changes: Sequence[tuple[str, Any]] = (),
) -> list[Task]:  # fmt: skip
    """Every row that there is to be, the slowest engines first, so that no worker waits at last."""
    slow = sorted(engines, key=lambda engine: engine.model not in SLOW)
    return [
        Task(law, engine, rate, extent, tuple(changes))
        for engine in slow for rate in sorted(extent.rates, reverse=True) for law in laws
    ]  # fmt: skip


def check_changes(engines: Iterable[EngineModel], changes: Sequence[tuple[str, Any]]) -> None:
    """Refuse changes that no row could be run with, before any is.

    Raises: ConfigError naming the key
    """
    for engine in engines:
        build(
            _tree(Task(engine.usual_law, engine, NOMINAL_HZ, QUICK, tuple(changes))),
            f"{engine} --set",
        )


def survey(
    todo: Sequence[Task], workers: int, advance: Callable[[Row], None] = lambda _: None
) -> list[Row]:
    """Fill in all rows, in the order of engines, rates and laws; `advance` is told each before."""
    rows = []
    asked = sorted({(task.engine, task.extent, task.changes, known)
                    for task in todo for known in get_args(Informed)}, key=str)  # fmt: skip
    with worker_pool(workers) as pool:
        worst = dict(zip(asked, pool.map(bound_row, asked), strict=True))
        for task, found in zip(todo, pool.map(row_of, todo), strict=True):
            known = known_to(task.law)
            peak, settling, sigma = worst[task.engine, task.extent, task.changes, known]
            rows.append(found._replace(bound_mm=peak, bound_ms=settling, sigma_least_mm=sigma))
            advance(rows[-1])
    return in_order(rows)


def in_order(rows: Iterable[Row]) -> list[Row]:
    """Rows by engine, rate and law."""
    laws = {name: place for place, name in enumerate(LAWS)}
    engines = {tuple(engine): place for place, engine in enumerate(ENGINES)}
    return sorted(rows, key=lambda row: (
        engines.get((row.engine, row.model), len(engines)), row.rate_hz,
        laws.get(row.law, len(laws)),
    ))  # fmt: skip


def known_to(law: str) -> Informed:
    """What a law can know when it fixes the fuel: one that watches the ticks knows all."""
    return "full" if watches(law) else "mid-stroke"


def bound_row(
    asked: tuple[EngineModel, Extent, tuple[tuple[str, Any], ...], Informed],
) -> tuple[float | None, float | None, float | None]:
    """Largest peak and longest settling of the bound over the steps, and the least scatter."""
    engine, extent, changes, known = asked
    base = resolve(
        build(_tree(Task(engine.usual_law, engine, NOMINAL_HZ, extent, changes)), str(engine))
    )
    find, steps = bound_of(base), [(load, part) for load in LOADS for part in extent.fractions]
    peak, settling = _worst(find(*step, known) for step in steps) if find else (None, None)
    return peak, settling, least_sigma_mm(base, EFFICIENCY)


def row_of(task: Task) -> Row:
    """Run one law on one engine at one rate."""
    name = Row(task.law, task.engine.prototype, task.engine.model, task.rate_hz)
    try:
        base = resolve(build(_tree(task), str(task.engine)))
        steps = [_step(task, load, part) for load in LOADS for part in task.extent.fractions]
        noise = _noise(task) if task.rate_hz == NOMINAL_HZ else None
    except ConfigError as error:
        return name._replace(note=str(error))
    found = _worst(response for response, _ in steps)
    courses = [course for _, course in steps] + ([] if noise is None else [noise])
    return name._replace(
        peak_mm=found[0], settling_ms=found[1],
        sigma_mm=None if noise is None else _sigma_mm(noise, base),
        lost=sum(map(_is_lost, courses)),
        misfires=sum(event.code == "misfire" for course in courses for event in course.events),
    )  # fmt: skip


def _tree(task: Task, **settings: Any) -> Tree:  # noqa: ANN401
    """The steady scenario of a row, in lockstep and without expectations."""
    tree = {**read_toml(scenarios.find("steady")), "expect": {}}
    given = {
        "plant.prototype": task.engine.prototype, "plant.model": task.engine.model,
        "controller.name": task.law, "loop.rate_hz": task.rate_hz, "loop.clock": "lockstep",
        **dict(task.changes), **settings,
    }  # fmt: skip
    for key, value in given.items():
        tree = with_override(tree, key, value)
    return tree


def _run(task: Task, settings: Tree) -> tuple[Resolved, Course]:
    """Run a row's engine with an event; open loop burns what keeps the set point."""
    if task.law == NO_CONTROL:
        fuel_kg = resolve(build(_tree(task, **{"controller.name": task.engine.usual_law}), "x"))
        settings |= {"controller.open_loop.fuel_kg": fuel_kg.controller.preset.fuel_kg}
    scenario = resolve(build(_tree(task, **settings), str(task.engine)))
    return scenario, fired(scenario, simulate(scenario))


def _step(task: Task, load: float, fraction: float) -> tuple[Response, Course]:
    """One load step."""
    event = {"kind": "load-scale", "value": load, "at_s": BEFORE_S, "at_stroke_fraction": fraction}
    scenario, course = _run(
        task, {"run.duration_s": BEFORE_S + AFTER_S + 0.1, "events.load": event}
    )
    step_ns = next((e.t_ns for e in course.events if e.code == "disturbance"), 0)
    ref_m = scenario.controller.tdc_ref_m
    after = [dc for dc in course.dead_centres if step_ns < dc.t_ns <= step_ns + AFTER_S * 1e9]
    times = tuple((dc.t_ns - step_ns) * 1e-9 for dc in after)
    return Response(times, tuple((abs(dc.x_m) - ref_m) * 1e3 for dc in after)), course


def _noise(task: Task) -> Course:
    """A run under combustion noise."""
    low, high = EFFICIENCY
    event = {"kind": "efficiency", "low": low, "high": high}
    duration_s = TO_SETTLE_S + task.extent.noise_s
    return _run(task, {"run.duration_s": duration_s, "events.noise": event})[1]


def _sigma_mm(course: Course, base: Resolved) -> float | None:
    """Scatter of the dead centres once the run has settled [mm]."""
    errors = [
        1e3 * (abs(dc.x_m) - base.controller.tdc_ref_m)
        for dc in course.dead_centres if dc.t_ns > TO_SETTLE_S * 1e9
    ]  # fmt: skip
    return statistics.pstdev(errors) if len(errors) > 1 else None


def _worst(responses: Iterable[Response]) -> tuple[float | None, float | None]:
    """Largest peak [mm] and longest settling [ms]; None where there is none."""
    found = list(responses)
    if not found:
        return None, None
    peak = max(r.peak_mm if r.errors_mm else math.inf for r in found)
    settling = max(r.settling_ms for r in found)
    return _finite(peak), _finite(settling)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _is_lost(course: Course) -> bool:
    """Whether a run did not end as it should, or touched a head."""
    return course.mode != "generating" or any(e.code == "contact" for e in course.events)
