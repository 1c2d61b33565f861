"""The closed loop against what an independent computation of the same equations reached.

Load steps of 15 % at a quarter and at three quarters of a stroke (thesis section 6.3).
"""

from functools import lru_cache
from statistics import mean, stdev

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from bench.studies.trial import Cell, judge, trial_of
from bench.studies.tune import gains_in_force
from hil.config.load import build, with_override
from hil.toml import read_toml

SETTLING_MS = 175.0
CASCADE_PEAKS_MM = {
    Cell("harmonic", 0.85, 0.25): 1.885,
    Cell("harmonic", 0.85, 0.75): 2.11,
    Cell("harmonic", 1.15, 0.25): 1.65,
    Cell("harmonic", 1.15, 0.75): 1.82,
    Cell("rectangular", 0.85, 0.25): 1.57,
    Cell("rectangular", 0.85, 0.75): 1.78,
    Cell("rectangular", 1.15, 0.25): 1.313,
    Cell("rectangular", 1.15, 0.75): 1.441,
}
SINGLE_LOOP_PEAKS_MM = {
    Cell("harmonic", 0.85, 0.25): 2.52,
    Cell("harmonic", 0.85, 0.75): 2.44,
    Cell("harmonic", 1.15, 0.25): 1.98,
    Cell("harmonic", 1.15, 0.75): 1.89,
    Cell("rectangular", 0.85, 0.25): 2.13,
    Cell("rectangular", 0.85, 0.75): 2.11,
}


@lru_cache
def judged(law, cell):
    return judge(cell, law, gains_in_force(law))


def run(name, **settings):
    """Run a scenario that ships with the project; keys with __ for dots."""
    tree = with_override(read_toml(find(name)), "loop.clock", "lockstep")
    for key, value in settings.items():
        tree = with_override(tree, key.replace("__", "."), value)
    return simulate(resolve(build(tree, name)))


def errors_mm(course, after_s=0.0, tdc_ref_mm=15.5):
    return [abs(dc.x_m) * 1e3 - tdc_ref_mm for dc in course.dead_centres if dc.t_ns > after_s * 1e9]


def codes(course):
    return [event.code for event in course.events]


@pytest.mark.parametrize("cell", trial_of().cells, ids=str)
def test_cascade_settles_in_time_with_the_peak_that_the_equations_give(cell):
    result = judged("cascade", cell)
    assert result.settling_ms <= SETTLING_MS
    assert result.peak_mm == pytest.approx(CASCADE_PEAKS_MM[cell], rel=0.05)


@pytest.mark.parametrize("cell", SINGLE_LOOP_PEAKS_MM, ids=str)
def test_single_loop_has_the_peak_that_its_delay_costs(cell):
    assert judged("single-loop", cell).peak_mm == pytest.approx(
        SINGLE_LOOP_PEAKS_MM[cell], rel=0.10
    )


@pytest.mark.parametrize("cell", [c for c in trial_of().cells if c.load < 1.0], ids=str)
def test_cascade_beats_the_single_loop_on_the_load_decrease(cell):
    """A lower peak and a shorter settling (thesis Fig 6.10)."""
    cascade, single = judged("cascade", cell), judged("single-loop", cell)
    assert cascade.peak_mm < single.peak_mm
    assert cascade.settling_ms < single.settling_ms


@pytest.mark.parametrize("model", ["harmonic", "rectangular"])
@pytest.mark.parametrize("load", [0.85, 1.15])
def test_step_before_mid_stroke_has_the_smaller_peak(model, load):
    """Thesis Fig 6.12: what is seen at mid-stroke can be answered one stroke earlier."""
    early, late = (judged("cascade", Cell(model, load, f)) for f in (0.25, 0.75))
    assert early.peak_mm < late.peak_mm


@pytest.mark.parametrize("fraction", [0.25, 0.75])
def test_without_control_the_new_amplitude_is_that_of_eq_5_60(fraction):
    """X is proportional to 1 / c at fixed fuel: 15.5 mm / 0.85 = 18.235 mm."""
    course = run("load-decrease", controller__name="open-loop",
                 events__load__at_stroke_fraction=fraction)  # fmt: skip
    assert errors_mm(course, 2.0)[-1] == pytest.approx(15.5 / 0.85 - 15.5, abs=0.02)


@pytest.mark.parametrize("law", ["cascade", "single-loop"])
@pytest.mark.parametrize("model", ["closed-form", "harmonic", "rectangular", "nonlinear"])
def test_settled_engine_holds_its_set_point(model, law):
    course = run("steady", plant__model=model, controller__name=law)
    assert course.mode == "generating"
    assert codes(course) == []
    assert max(map(abs, errors_mm(course))) < 0.02


@pytest.mark.parametrize("tdc_mm", [13.0, 16.5])
def test_other_set_points_are_held_too(tdc_mm):
    course = run("steady", controller__tdc_ref_m=tdc_mm * 1e-3)
    assert max(map(abs, errors_mm(course, 0.0, tdc_mm))) < 0.02


def test_other_prototype_holds_its_own_set_point():
    course = run("steady", plant__prototype="bit")
    assert codes(course) == []
    assert max(map(abs, errors_mm(course, 0.0, 30.0))) < 0.04


@pytest.mark.parametrize("rate_hz", [500, 2000, 5000])
def test_rate_of_the_loop_changes_the_peak_by_little(rate_hz):
    course = run("load-decrease", loop__rate_hz=rate_hz)
    step_s = next(e.t_ns for e in course.events if e.code == "disturbance") * 1e-9
    errors = errors_mm(course, step_s)
    assert max(errors) == pytest.approx(1.885, rel=0.08)
    assert max(map(abs, errors_mm(course, step_s + 0.25))) < 0.1


@pytest.mark.parametrize("model", ["closed-form", "harmonic", "rectangular"])
def test_engine_starts_from_rest_and_reaches_its_set_point_generating(model):
    course = run("start", plant__model=model)
    assert course.mode == "generating"
    assert "contact" not in codes(course)
    assert max(map(abs, errors_mm(course, 3.1))) < 0.1


@pytest.mark.parametrize("cause", ["spark", "fuel"])
@pytest.mark.parametrize("model", ["harmonic", "rectangular"])
def test_single_misfire_is_recovered(model, cause):
    course = run("misfire", plant__model=model, events__misfire__cause=cause)
    assert course.mode == "generating"
    assert codes(course).count("misfire") == 1
    assert "contact" not in codes(course)
    assert max(map(abs, errors_mm(course, 4.1))) < 0.1


def test_engine_starts_and_starts_again_after_a_misfire():
    course = run("start-restart")
    assert course.mode == "generating"
    assert "contact" not in codes(course)
    assert max(map(abs, errors_mm(course, 7.1))) < 0.1


def test_misfires_that_do_not_end_lead_to_the_safe_state_and_to_rest():
    course = run("misfire", events__misfire__count=1000, controller__start__timeout_s=0.5)
    assert course.mode == "safe"
    assert codes(course)[-1] == "at-rest"


def test_varying_combustion_stays_within_a_millimetre():
    """Efficiency uniform in [0.95, 1] (thesis Fig 5.10)."""
    course = run("variations")
    errors = errors_mm(course, 1.0)
    assert course.mode == "generating"
    assert codes(course) == ["disturbance"]
    assert max(map(abs, errors)) < 1.0
    assert abs(mean(errors)) < 0.05
    assert stdev(errors) < 0.4


@pytest.mark.parametrize("step", ["load-decrease-variations", "load-increase-variations"])
def test_load_step_on_varying_combustion_is_mastered(step):
    course = run(step)
    assert course.mode == "generating"
    assert max(map(abs, errors_mm(course, 1.5))) < 1.0
    assert abs(mean(errors_mm(course, 1.5))) < 0.1


@pytest.mark.parametrize("value", [0.95, 1.05])
def test_nonlinear_engine_is_held_through_small_load_steps(value):
    course = run("load-decrease", plant__model="nonlinear", events__load__value=value)
    assert course.mode == "generating"
    assert "contact" not in codes(course)
    assert max(map(abs, errors_mm(course, 1.8))) < 0.1


def test_sensor_noise_is_not_driven_into_the_engine():
    course = run("steady", plant__sensors__noise_x_m=1e-6, plant__sensors__noise_v_m_s=1e-3)
    assert max(map(abs, errors_mm(course))) < 0.1
    assert [code for code in codes(course) if code == "misfire"] == []
