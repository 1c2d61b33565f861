"""Set points from a target power, and how the load gets there."""

import pytest

from controller import supervisory
from controller.knowledge import operating_point
from hil.config.controller import ControllerConfig, Preset, SupervisoryConfig
from hil.config.prototypes import NU

LIMIT_M = 0.0195


def config(preset=None, **values):
    return ControllerConfig(supervisory=SupervisoryConfig(**values), preset=preset or Preset())


def test_without_a_target_power_the_engines_own_figures_hold():
    s = supervisory.initial(config(), NU)
    assert (s.tdc_ref_m, s.load_n_s_m, s.throttle) == (0.0155, 810.0, 1.0)
    assert s.point == operating_point(NU, 0.0155, 810.0)


def test_configured_load_comes_before_the_engines():
    assert supervisory.initial(config(load_coefficient_n_s_m=500.0), NU).load_n_s_m == 500.0


@pytest.mark.parametrize("power", [200.0, 800.0, 1400.0])
def test_target_power_sets_the_load_that_delivers_it(power):
    s = supervisory.initial(config(target_power_w=power), NU)
    assert 0.5 * s.load_n_s_m * s.point.v_mid_m_s**2 == pytest.approx(power, rel=1e-6)


def test_no_target_power_asks_more_than_the_full_load():
    c = config(target_power_w=10_000.0)
    assert supervisory.initial(c, NU).load_n_s_m == supervisory.full_load(c, NU) == 810.0


def test_full_load_is_never_below_the_engines_nominal_one():
    assert supervisory.full_load(config(load_coefficient_n_s_m=100.0), NU) == 810.0
    assert supervisory.full_load(config(load_coefficient_n_s_m=1000.0), NU) == 1000.0


def test_preset_is_met_exactly_at_the_start():
    preset = Preset(fuel_kg=2.474e-6, v_mid_m_s=1.7, stroke_s=0.028)
    point = supervisory.initial(config(preset), NU).point
    figures = (point.fuel_kg, point.v_mid_m_s, point.stroke_s)
    assert figures == pytest.approx((2.474e-6, 1.7, 0.028), rel=1e-12)


def test_preset_moves_as_the_closed_form_says():
    preset = Preset(fuel_kg=2.474e-6, v_mid_m_s=1.7, stroke_s=0.028)
    c = config(preset)
    here, there = operating_point(NU, 0.0155, 810.0), operating_point(NU, 0.014, 700.0)
    point = supervisory.with_preset(c, NU, 0.014, 700.0)
    assert point.fuel_kg / 2.474e-6 == pytest.approx(there.fuel_kg / here.fuel_kg)
    assert point.v_mid_m_s / 1.7 == pytest.approx(there.v_mid_m_s / here.v_mid_m_s)
    assert point.stroke_s / 0.028 == pytest.approx(there.stroke_s / here.stroke_s)


def test_new_tdc_moves_at_once_by_what_a_stroke_allows_and_the_load_slews():
    c = config(load_slew_n_s_m_per_s=1000.0)
    s = supervisory.change(c, NU, supervisory.initial(c, NU), 0.014, 500.0, LIMIT_M)
    assert (s.tdc_ref_m, s.tdc_target_m) == (pytest.approx(0.0145), 0.014)
    assert supervisory.approach(c, NU, s, LIMIT_M).tdc_ref_m == 0.014
    assert s.load_n_s_m == 810.0
    assert s.load_target_n_s_m == pytest.approx(
        supervisory.target_load(c, NU, 0.014, 500.0), rel=1e-12
    )


@pytest.mark.parametrize("power", [100.0, 1400.0])
def test_load_moves_by_no_more_than_its_slew_and_arrives(power):
    c = config(target_power_w=600.0, load_slew_n_s_m_per_s=1000.0)
    s = supervisory.change(c, NU, supervisory.initial(c, NU), None, power, LIMIT_M)
    for _ in range(2000):
        after = supervisory.slew(c, NU, s, 1e-3)
        assert abs(after.load_n_s_m - s.load_n_s_m) <= 1.0 + 1e-9
        s = after
    assert s.load_n_s_m == s.load_target_n_s_m
    assert s.point.fuel_kg == pytest.approx(operating_point(NU, 0.0155, s.load_n_s_m).fuel_kg)
    assert supervisory.slew(c, NU, s, 1e-3) is s


def test_what_the_operator_does_not_name_stays():
    c = config(target_power_w=600.0)
    s = supervisory.initial(c, NU)
    assert (
        supervisory.change(c, NU, s, 0.0145, None, LIMIT_M).load_target_n_s_m == s.load_target_n_s_m
    )
    assert supervisory.change(c, NU, s, None, 500.0, LIMIT_M).tdc_ref_m == s.tdc_ref_m
