"""The physical bound against the closed forms and against what no law can beat."""

import math

import pytest

from bench.judge.response import Response
from bench.studies.bound import LoadChange, bound, deadbeat_fuel, step_bound, stroke_end
from hil.config.prototypes import BIT, NU
from hil.errors import ConfigError
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc, limit_cycle

H, R = constants_of(NU, "harmonic"), constants_of(NU, "rectangular")
REF, LOAD = 0.0155, 810.0

FULL = [
    (H, 0.85, 0.25, 1.885, 47),
    (H, 0.85, 0.75, 0.25, 34),
    (H, 1.15, 0.25, 1.65, 41),
    (H, 1.15, 0.75, 0.23, 29),
    (R, 0.85, 0.25, 1.57, 54),
    (R, 0.85, 0.75, 0.15, 40),
]
MID_STROKE = [(H, 0.85, 2.11), (H, 1.15, 1.82), (R, 0.85, 1.78), (R, 1.15, 1.441)]


@pytest.mark.parametrize(("engine", "scale", "fraction", "peak_mm", "settling_ms"), FULL)
def test_with_full_knowledge_only_the_first_dead_centre_is_wrong(
    engine, scale, fraction, peak_mm, settling_ms
):
    found = step_bound(engine, REF, LOAD, scale, fraction)
    assert found.peak_mm == pytest.approx(peak_mm, abs=0.005)
    assert found.settling_ms == pytest.approx(settling_ms, abs=0.6)
    assert max(map(abs, found.errors_mm[1:])) < 1e-5


@pytest.mark.parametrize(("engine", "scale", "peak_mm"), MID_STROKE)
def test_what_is_known_at_mid_stroke_misses_a_later_step_by_one_stroke(engine, scale, peak_mm):
    late = step_bound(engine, REF, LOAD, scale, 0.75, "mid-stroke")
    assert late.peak_mm == pytest.approx(peak_mm, abs=0.005)
    assert abs(late.errors_mm[1]) == late.peak_mm
    assert max(map(abs, late.errors_mm[2:])) < 1e-5


@pytest.mark.parametrize("engine", [H, R])
def test_a_step_before_mid_stroke_costs_the_same_with_either_knowledge(engine):
    full = step_bound(engine, REF, LOAD, 0.85, 0.25)
    mid = step_bound(engine, REF, LOAD, 0.85, 0.25, "mid-stroke")
    assert mid.errors_mm == pytest.approx(full.errors_mm, abs=1e-6)


def test_without_control_the_error_goes_where_the_closed_form_says():
    found = step_bound(H, REF, LOAD, 0.85, 0.25, "none", strokes=60)
    assert found.errors_mm[-1] == pytest.approx(1e3 * REF * (1.0 / 0.85 - 1.0), abs=1e-3)
    assert found.settling_ms == math.inf


@pytest.mark.parametrize("model", ["harmonic", "rectangular", "nonlinear"])
@pytest.mark.parametrize("prototype", [NU, BIT])
def test_deadbeat_fuel_of_the_settled_engine_is_its_steady_fuel(prototype, model):
    engine = constants_of(prototype, model)
    ref, load = prototype.tdc_ref_m, prototype.load_coefficient_n_s_m
    fuel = fuel_for_tdc(engine, ref, load)
    assert deadbeat_fuel(engine, ref, ref, load) == pytest.approx(fuel, rel=1e-5)


def test_fuel_stays_within_its_limits():
    assert deadbeat_fuel(H, REF, 0.030, LOAD) == 6.0e-6
    assert deadbeat_fuel(H, 0.019, 1e-4, LOAD) == 0.2e-6


def test_a_stroke_of_the_settled_engine_ends_where_it_began():
    fuel = fuel_for_tdc(R, REF, LOAD)
    end = stroke_end(R, REF, fuel, (LoadChange(0.0, LOAD),))
    assert end.tdc_m == pytest.approx(REF, abs=1e-9)
    assert end.duration_s == pytest.approx(0.5 / limit_cycle(R, fuel, LOAD).frequency_hz, rel=1e-9)


def test_a_ramp_costs_what_each_stroke_cannot_foresee():
    ramp = tuple(LoadChange(0.001 * k, LOAD * (1.0 - 0.0015 * k)) for k in range(1, 101))
    found = bound(H, REF, LOAD, ramp)
    step = step_bound(H, REF, LOAD, 0.85, 0.25)
    assert 0.1 < found.peak_mm < step.peak_mm
    assert abs(found.errors_mm[-1]) < 1e-5


def test_a_weak_combustion_costs_one_stroke():
    found = bound(H, REF, LOAD, (), efficiencies=(0.95,))
    assert found.errors_mm[0] < -0.3
    assert abs(found.errors_mm[1]) < 1e-5


def test_settling_of_a_bound_that_never_leaves_the_band_is_the_first_dead_centre():
    assert Response((0.02, 0.04), (0.05, 0.0)).settling_ms == pytest.approx(20.0)


def test_no_settled_motion_is_said_so():
    with pytest.raises(ConfigError):
        step_bound(H, REF, 0.0, 0.85, 0.25)
