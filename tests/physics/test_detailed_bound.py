"""The physical bound on the two-stroke engine: deadbeat by its own equations of motion."""

import pytest

from bench.studies.bound_detailed import step_bound
from hil.config.detailed import read
from plant.engines.detailed.settle import settle

ENGINE = read("nu-two-stroke")
FUEL_KG = ENGINE.heat.energy_j / ENGINE.heat.heating_value_j_kg
LOAD = ENGINE.machine.load_coefficient_n_s_m


def bound(scale, fraction, knowledge="full"):
    tdc_m = settle(ENGINE, FUEL_KG, LOAD).tdc_m
    return step_bound(ENGINE, tdc_m, FUEL_KG, LOAD, scale, fraction, knowledge)


def test_without_a_step_the_fuel_is_that_of_the_settled_engine():
    found = bound(1.0, 0.25)
    assert found.peak_mm < 0.002
    assert found.fuel_kg == pytest.approx([FUEL_KG] * 12, rel=1e-3)


@pytest.mark.parametrize("scale", [0.85, 1.15])
@pytest.mark.parametrize("fraction", [0.25, 0.75])
def test_after_the_first_error_every_stroke_ends_at_the_set_point(scale, fraction):
    first, *later = bound(scale, fraction).errors_mm
    assert first * (1.0 - scale) > 0.0
    assert max(map(abs, later)) < 0.01


@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_a_step_behind_mid_stroke_is_met_a_stroke_later_by_who_learns_of_it_at_mid_stroke(scale):
    assert bound(scale, 0.75).peak_mm < 0.2
    late = bound(scale, 0.75, "mid-stroke").errors_mm
    assert abs(late[1]) > 1.0
    assert max(map(abs, late[2:])) < 0.01
    assert bound(scale, 0.25, "mid-stroke") == bound(scale, 0.25)
