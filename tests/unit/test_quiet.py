"""Combustion noise is left alone, and a change under it is not."""

import random
import statistics
from functools import cache

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import tree_of
from bench.studies import survey
from bench.studies.compare import NO_CONTROL
from bench.studies.survey import EFFICIENCY, EngineModel, Extent, Task
from controller.motion.laws import LAWS
from controller.motion.quiet import NOTHING_SEEN, Quiet
from hil.config.load import build, with_override
from hil.config.motion.laws import QuietConfig

QUIET = Quiet(QuietConfig())
SIGMA_M = 0.12e-3
LINEAR = ("harmonic", "rectangular")
ONLY_NOISE = Extent((), (1000,), 6.0)


def noisy(seed=1, strokes=160):
    """What is known after strokes that err by combustion noise alone."""
    drawn, noise = random.Random(seed), NOTHING_SEEN
    for stroke in range(strokes):
        noise = noise.after(QUIET, drawn.uniform(-1.7, 1.7) * SIGMA_M, stroke % 2)
    return noise


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_learnt_and_takes_most_of_the_gains(seed):
    noise = noisy(seed)
    assert 0.7 * SIGMA_M < noise.sigma_m < 1.4 * SIGMA_M
    assert noise.share(QUIET) == QUIET.share


@pytest.mark.parametrize("e_m", [6.0 * SIGMA_M, -6.0 * SIGMA_M])
def test_one_error_that_is_too_large_brings_all_gains_back_for_some_strokes(e_m):
    noise = noisy().after(QUIET, e_m, 0)
    assert noise.share(QUIET) == 1.0
    for stroke in range(1, QUIET.strokes + 1):
        noise = noise.after(QUIET, 0.0, stroke % 2)
    assert noise.share(QUIET) == QUIET.share


def test_the_speed_within_a_stroke_can_tell_it_before_the_dead_centre():
    assert noisy().after(QUIET, 0.0, 0, next_m=6.0 * SIGMA_M).share(QUIET) == 1.0


@pytest.mark.parametrize("sides", [(1.0, 1.0), (1.0, -1.0)])
def test_errors_of_one_sign_at_a_side_are_no_noise(sides):
    noise, drawn, told = noisy(), random.Random(7), []
    for stroke in range(24):
        e_m = SIGMA_M * (3.0 * sides[stroke % 2] + drawn.uniform(-0.5, 0.5))
        noise = noise.after(QUIET, e_m, stroke % 2)
        told.append(noise.share(QUIET))
    assert 1.0 in told


def test_a_load_step_without_noise_leaves_the_gains_as_they_are():
    noise = NOTHING_SEEN
    for stroke, e_mm in enumerate((0.0, 1.9, 0.9, -0.5, 0.4, -0.2, 0.1, 0.05, 0.02, *[0.0] * 40)):
        noise = noise.after(QUIET, 1e-3 * e_mm, stroke % 2)
        assert noise.share(QUIET) == 1.0


def test_switched_off_it_sees_nothing():
    off = Quiet(QuietConfig(enabled=False))
    noise = NOTHING_SEEN.after(off, 1e-4, 0)
    assert noise is NOTHING_SEEN
    assert noise.share(off) == 1.0


@cache
def row(law, model, enabled=True):
    """Scatter of a law under combustion noise [mm], from the second second on."""
    changes = (("controller.quiet.enabled", enabled),)
    task = Task(law, EngineModel("nu", model), 1000, ONLY_NOISE, changes)
    return survey.row_of(task).sigma_mm


def laws_under_noise():
    """The laws that are for engines that fire in every stroke."""
    return [law for law in LAWS if not LAWS[law].needs_driven and law != NO_CONTROL]


@pytest.mark.parametrize("model", LINEAR)
@pytest.mark.parametrize("law", laws_under_noise())
def test_no_law_scatters_much_more_than_no_law(law, model):
    assert row(law, model) < 1.15 * row(NO_CONTROL, model)


@pytest.mark.parametrize("law", ["cascade", "predictive", "pdf"])
def test_nor_where_the_gas_hardens(law):
    assert row(law, "nonlinear") < 1.15 * row(NO_CONTROL, "nonlinear")


@pytest.mark.parametrize("model", LINEAR)
def test_the_best_law_leaves_the_least_that_there_can_be(model):
    engine = EngineModel("nu", model)
    least = survey.bound_row((engine, ONLY_NOISE, (), "full"))[2]
    assert row("pdf", model) < 1.05 * least


def test_the_switch_is_what_makes_the_cascade_quiet():
    assert row("cascade", "harmonic", enabled=False) > 1.4 * row("cascade", "harmonic")


NOISY = {"kind": "efficiency", "low": EFFICIENCY[0], "high": EFFICIENCY[1]}
STEP_S = 2.6


def step_mm(law, enabled):
    """The first strokes of a load step under noise [mm]: their means over some draws."""
    found = []
    for seed in range(3):
        changes = (
            ("controller.name", law), ("controller.quiet.enabled", enabled), ("run.seed", seed),
            ("run.duration_s", STEP_S + 0.5), ("events.noise", NOISY),
            ("events.load.at_s", STEP_S), ("loop.clock", "lockstep"),
        )  # fmt: skip
        tree = tree_of("load-decrease")
        for key, value in changes:
            tree = with_override(tree, key, value)
        course = simulate(resolve(build(tree, law)))
        found.append(
            [1e3 * abs(dc.x_m) - 15.5 for dc in course.dead_centres if dc.t_ns > 1e9 * STEP_S]
        )
    return [statistics.mean(strokes) for strokes in zip(*found, strict=False)]


@pytest.mark.parametrize("law", ["cascade", "single-loop", "predictive", "observer"])
def test_a_load_step_under_noise_is_answered_as_fast(law):
    plain, quiet = step_mm(law, enabled=False), step_mm(law, enabled=True)
    assert max(map(abs, quiet)) < max(map(abs, plain)) + 0.1
    assert abs(statistics.mean(quiet[6:])) < 0.1
