"""What holds of every engine in full: energy, mass, and convergence with the step."""

from __future__ import annotations

import numpy as np

from bench.studies.atlas.entry import Entry, Found
from bench.web.chart import Chart, series
from hil.config.detailed import calibrations, read
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Engine, Motion, engine_of, run_for, running, strokes
from plant.engines.detailed.figures import cycle_rows, settled
from plant.engines.detailed.types import Array

STEPS_S = (4.0e-4, 2.0e-4, 1.0e-4, 5.0e-5, 2.0e-5)
_FINEST_S = 2.5e-6
_FOLLOWED_S = 0.15


def fired_engines() -> list[str]:
    """The engines that run by themselves."""
    return sorted(c.name for c in calibrations().values()
                  if c.cycle.kind in {"two-stroke", "four-stroke"})  # fmt: skip


def balances(engine: Engine, motion: Motion) -> tuple[float, float]:
    """What is missing of energy and of mass over a cycle, as shares of fuel and of the flow."""
    rows = cycle_rows(engine, motion, 1)
    sums = (rows[-1] - rows[0])[at.REC_SUMS :]
    gas = [at.U, at.U + 2, at.CASE_U, at.CASE_U + 2]
    fuel = _both(sums, at.Q_FUEL)
    out = _both(sums, at.Q_WALL) + _both(sums, at.H_EX) - _both(sums, at.H_IN)
    out += _both(sums, at.W_GAS)
    energy = abs(fuel - out - float(np.sum(sums[gas[:2]])) - _leaked(sums)) / fuel
    through = _both(sums, at.M_IN)
    kept = (
        through
        - _both(sums, at.M_EX)
        - _both(sums, at.M_LEAK)
        - float(np.sum(sums[[at.M, at.M + 2]]))
    )
    return energy, abs(kept) / through


def _leaked(sums: Array) -> float:
    return _both(sums, at.H_LEAK)


def _both(sums: Array, which: int) -> float:
    return float(sums[at.SUM + which] + sums[at.SUM + at.SUM_STRIDE + which])


def step_error_m(name: str, step_s: float) -> float:
    """By how much the first dead centres lie elsewhere than with a step of 2.5 us."""
    engine = engine_of(read(name))
    found = []
    for step in (step_s, _FINEST_S):
        p = engine.p.copy()
        p[at.STEP_S] = step
        tried = engine._replace(p=p)
        found.append(strokes(run_for(tried, running(tried), _FOLLOWED_S))[:, at.REC_X])
    count = min(len(x) for x in found)
    return float(np.max(np.abs(found[0][:count] - found[1][:count])))


def validation(quick: bool) -> Found:
    """Balances over a settled cycle, and the error of the dead centres over the step."""
    names = fired_engines()[:2] if quick else fired_engines()
    missing = []
    for name in names:
        engine = engine_of(read(name))
        missing.append(balances(engine, settled(engine)))
    order = range(1, len(names) + 1)
    which = ", ".join(f"{n} {name}" for n, name in zip(order, names, strict=True))
    kept = tuple(series(label, order, [max(m[k], 1e-16) for m in missing], "points")
                 for k, label in enumerate(("energy", "mass")))  # fmt: skip
    steps = tuple(series(name, [1e6 * s for s in STEPS_S],
                         [1e6 * step_error_m(name, s) for s in STEPS_S], "both")
                  for name in names)  # fmt: skip
    return Found({}, (
        Chart("Missing of a cycle's balance", which, "share", kept),
        Chart("Error of the dead centres", "step [us]", "error [um]", steps, (), True),
    ))  # fmt: skip


ENTRIES = (Entry("S3.3.2", "Balances and convergence of every engine", (), validation, "", 4.0),)
