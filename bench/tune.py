"""Finding the gains of the piston-motion laws, and judging those in force.

    python -m bench.tune cascade             judge the gains of the default configuration
    python -m bench.tune cascade --search    look for better ones

Eight cells: steps of -15 % and +15 % of the load, at a quarter and three quarters of a stroke, on
the `harmonic` and the `rectangular` model. One set of gains for all of them (docs/tuning.md).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NamedTuple

from bench.offline import Course, simulate
from bench.resolve import resolve
from bench.scenarios import find
from hil.config.load import build, read_toml, with_override
from hil.config.scenario import Scenario

BAND_MM = 0.1
MODELS = ("harmonic", "rectangular")
LOADS = (0.85, 1.15)
FRACTIONS = (0.25, 0.75)

LATE_S = 0.14
"""From here on after the step an error counts against the margin in the band."""

FEWEST_STROKES = 10

EVENT_S = 0.1
DURATION_S = 0.75


class Cell(NamedTuple):
    """One load step on one model."""

    model: str
    load: float
    fraction: float

    def __str__(self) -> str:
        return f"{self.model:<11} {100 * (self.load - 1):+3.0f} % at {self.fraction:g}"


CELLS = tuple(Cell(m, load, f) for m in MODELS for load in LOADS for f in FRACTIONS)


class Result(NamedTuple):
    """TDC errors [mm] after the step with their times [s], and what is read off them."""

    times_s: tuple[float, ...]
    errors_mm: tuple[float, ...]

    @property
    def peak_mm(self) -> float:
        """Largest error."""
        return max(abs(error) for error in self.errors_mm)

    @property
    def late_mm(self) -> float:
        """Largest error after `LATE_S`: the margin that settling has in its band."""
        pairs = zip(self.times_s, self.errors_mm, strict=True)
        return max(abs(error) for t, error in pairs if t > LATE_S)

    @property
    def settling_ms(self) -> float:
        """From the step to the first dead centre after the last one outside the band."""
        outside = [i for i, error in enumerate(self.errors_mm) if abs(error) > BAND_MM]
        first = outside[-1] + 1 if outside else 0
        return 1e3 * self.times_s[first] if first < len(self.times_s) else float("inf")


def scenario_of(cell: Cell, law: str, gains: dict[str, float]) -> Scenario:
    """The load-decrease scenario for a cell, with the event early and the law's gains set."""
    tree = read_toml(find("load-decrease"))
    settings: dict[str, Any] = {
        "run.duration_s": DURATION_S,
        "plant.model": cell.model,
        "controller.name": law,
        "loop.clock": "lockstep",
        "events.load.value": cell.load,
        "events.load.at_s": EVENT_S,
        "events.load.at_stroke_fraction": cell.fraction,
        **{f"controller.{law.replace('-', '_')}.{key}": value for key, value in gains.items()},
    }
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    return resolve(build(tree, str(cell)))


def judge(cell: Cell, law: str, gains: dict[str, float]) -> Result:
    """Run one cell."""
    scenario = scenario_of(cell, law, gains)
    return read_off(simulate(scenario), scenario.controller.tdc_ref_m or 0.0)


def read_off(course: Course, tdc_ref_m: float) -> Result:
    """TDC errors from the load step on."""
    step_ns = next(event.t_ns for event in course.events if event.code == "disturbance")
    after = [dc for dc in course.dead_centres if dc.t_ns > step_ns]
    return Result(
        tuple((dc.t_ns - step_ns) * 1e-9 for dc in after),
        tuple((abs(dc.x_m) - tdc_ref_m) * 1e3 for dc in after),
    )


KEYS = {
    "cascade": ("outer.kp", "outer.ki", "inner.kp", "inner.ki"),
    "single-loop": ("tdc.kp", "tdc.ki"),
}


def cost(law: str, vector: Sequence[float]) -> float:
    """Worst cell's largest error late after the step, and a little of all squared errors.

    A set that is fine in seven cells and slow in one is not fine; the squares keep the search
    from paying for the last micrometre with a large overshoot.
    """
    gains = dict(zip(KEYS[law], vector, strict=True))
    results = [judge(cell, law, gains) for cell in CELLS]
    if any(len(result.errors_mm) < FEWEST_STROKES for result in results):
        return 1e6
    squares = sum(min(abs(e), 5.0) ** 2 for result in results for e in result.errors_mm)
    return max(result.late_mm for result in results) + 1e-3 * squares


def search(law: str, start: dict[str, float], generations: int) -> dict[str, float]:
    """Differential evolution, seeded, within a factor of two about the gains in force."""
    from scipy.optimize import differential_evolution

    x0 = [start[key] for key in KEYS[law]]
    bounds = [sorted((0.5 * gain, 2.0 * gain)) for gain in x0]
    found = differential_evolution(
        lambda x: cost(law, list(x)), bounds, x0=x0, maxiter=generations, popsize=6, rng=1,
        polish=False,
    )  # fmt: skip
    return dict(zip(KEYS[law], map(float, found.x), strict=True))


def gains_in_force(law: str) -> dict[str, float]:
    """The gains of the default configuration."""
    section = getattr(Scenario().controller, law.replace("-", "_"))
    pairs = (key.split(".") for key in KEYS[law])
    return {f"{loop}.{name}": getattr(getattr(section, loop), name) for loop, name in pairs}


def table(law: str, gains: dict[str, float]) -> str:
    """Peak and settling of every cell."""
    lines = [f"{law}: " + ", ".join(f"{key} = {value:.4g}" for key, value in gains.items())]
    for cell in CELLS:
        result = judge(cell, law, gains)
        lines.append(
            f"  {cell}: peak {result.peak_mm:.3f} mm, settles in {result.settling_ms:.0f} ms,"
            f" at most {result.late_mm:.3f} mm after {1e3 * LATE_S:.0f} ms"
        )
    return "\n".join(lines)


def main() -> None:
    """Judge, and search where asked."""
    parser = argparse.ArgumentParser(prog="python -m bench.tune", description=__doc__)
    parser.add_argument("law", choices=sorted(KEYS))
    parser.add_argument("--search", action="store_true")
    parser.add_argument("--generations", type=int, default=20)
    parser.add_argument("--from", dest="start", help="comma-separated gains to start from")
    given = parser.parse_args()
    gains = gains_in_force(given.law)
    if given.start:
        gains = dict(zip(KEYS[given.law], map(float, given.start.split(",")), strict=True))
    if given.search:
        gains = search(given.law, gains, given.generations)
    print(table(given.law, gains))


if __name__ == "__main__":
    main()
