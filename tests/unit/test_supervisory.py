"""Set points from a target power, how the load gets there, and what keeps it from it."""

import pytest

from controller.knowledge import operating_point
from controller.supervisory import (
    LOAD_RATE_LIMITED,
    POWER_LIMITED,
    POWER_WITHIN_REACH,
    SHORT_STROKES,
    Supervisor,
)
from hil.config.controller import ControllerConfig, LimitsConfig, Preset
from hil.config.prototypes import NU
from hil.config.supervisory.performance import MapOrigin, PerformanceMap
from hil.config.supervisory.section import SupervisoryConfig

PERIOD_S, LIMIT_M = 1e-3, 0.0195


def supervisor(preset=None, limits=None, **values):
    config = ControllerConfig(
        supervisory=SupervisoryConfig(**values), preset=preset or Preset(),
        limits=limits or LimitsConfig(),
    )  # fmt: skip
    return Supervisor(config, NU, PERIOD_S, LIMIT_M)


def row(tdc_m, loads, **figures):
    """A row whose power is 2 W for each N s/m."""
    n = len(loads)
    return {
        "tdc_m": tdc_m, "ends": "the engine stops", "load_n_s_m": loads,
        "power_w": tuple(2.0 * load for load in loads), "fuel_kg": (2e-6,) * n,
        "v_mid_m_s": (2.0,) * n, "stroke_s": (0.03,) * n, "efficiency": (0.3,) * n,
        "throttle": (1.0,) * n,
    } | figures  # fmt: skip


def performance_map(*rows):
    origin = MapOrigin(
        model="harmonic", prototype="nu", controller="cascade", version="1", strokes=20
    )
    columns = {name: tuple(row[name] for row in rows) for name in rows[0]}
    return PerformanceMap(origin=origin, **columns)


def test_without_a_target_power_the_engines_own_figures_hold():
    s = supervisor().initial()
    assert (s.tdc_ref_m, s.load_n_s_m, s.throttle) == (0.0155, 810.0, 1.0)
    assert s.point == operating_point(NU, 0.0155, 810.0)
    assert s.target is None


def test_configured_load_comes_before_the_engines():
    assert supervisor(load_coefficient_n_s_m=500.0).initial().load_n_s_m == 500.0


@pytest.mark.parametrize("power", [200.0, 800.0, 1400.0, 2500.0])
def test_target_power_sets_the_load_that_delivers_it(power):
    s = supervisor(target_power_w=power).initial()
    assert 0.5 * s.load_n_s_m * s.point.v_mid_m_s**2 == pytest.approx(power, rel=1e-6)
    assert s.load_target_n_s_m == pytest.approx(s.load_n_s_m, rel=1e-9)


def test_no_target_power_asks_more_than_fuel_and_machine_allow():
    plain = supervisor(target_power_w=9_000.0).initial()
    assert "time to inject" in plain.target.limit
    little = LimitsConfig(fuel_max_kg=3e-6)
    s = supervisor(limits=little, target_power_w=9_000.0).initial()
    assert "fuel_max_kg" in s.target.limit
    at_limit = operating_point(NU, 0.0155, s.load_target_n_s_m)
    assert at_limit.fuel_kg == pytest.approx(0.9 * 3e-6, rel=1e-6)
    weak = LimitsConfig(force_n=1000.0)
    s = supervisor(limits=weak, target_power_w=9_000.0).initial()
    assert "force_n" in s.target.limit
    at_limit = operating_point(NU, 0.0155, s.load_target_n_s_m)
    assert s.load_target_n_s_m * at_limit.v_mid_m_s == pytest.approx(1000.0, rel=1e-6)


def test_no_target_power_asks_for_less_than_an_injector_can_feed():
    s = supervisor(target_power_w=10.0).initial()
    assert "fuel_min_kg" in s.target.limit
    least = operating_point(NU, 0.0155, s.load_target_n_s_m)
    assert least.fuel_kg == pytest.approx(NU.fuel_min_kg, rel=1e-6)


def test_full_load_is_never_below_the_engines_nominal_one():
    assert supervisor(load_coefficient_n_s_m=100.0).full_load_n_s_m == 810.0
    assert supervisor(load_coefficient_n_s_m=1000.0).full_load_n_s_m == 1000.0


def test_preset_is_met_exactly_at_the_start():
    preset = Preset(fuel_kg=2.474e-6, v_mid_m_s=1.7, stroke_s=0.028)
    point = supervisor(preset).initial().point
    figures = (point.fuel_kg, point.v_mid_m_s, point.stroke_s)
    assert figures == pytest.approx((2.474e-6, 1.7, 0.028), rel=1e-12)


def test_preset_moves_as_the_closed_form_says():
    preset = Preset(fuel_kg=2.474e-6, v_mid_m_s=1.7, stroke_s=0.028)
    here, there = operating_point(NU, 0.0155, 810.0), operating_point(NU, 0.014, 700.0)
    point = supervisor(preset).performance.point(0.014, 700.0)
    assert point.fuel_kg / 2.474e-6 == pytest.approx(there.fuel_kg / here.fuel_kg)
    assert point.v_mid_m_s / 1.7 == pytest.approx(there.v_mid_m_s / here.v_mid_m_s)
    assert point.stroke_s / 0.028 == pytest.approx(there.stroke_s / here.stroke_s)


def test_the_power_of_the_preset_scales_what_the_closed_form_says():
    preset = Preset(power_w=3000.0, load_coefficient_n_s_m=810.0)
    performance = supervisor(preset, target_power_w=3000.0).performance
    assert performance.steady(0.0155, 810.0).power_w == pytest.approx(3000.0, rel=1e-12)
    reach = performance.reach(0.0155, 2000.0, 1.0)
    assert performance.steady(0.0155, reach.load_n_s_m).power_w == pytest.approx(2000.0, rel=1e-9)


def test_new_tdc_moves_by_what_a_stroke_allows_the_load_slews_and_that_is_told():
    s = supervisor(load_slew_n_s_m_per_s=1000.0)
    before = s.initial()
    after, events = s.changed(before, 0.014, 500.0)
    assert (after.tdc_ref_m, after.tdc_target_m) == (pytest.approx(0.0145), 0.014)
    assert s.approach(after).tdc_ref_m == 0.014
    assert after.load_n_s_m == 810.0
    reach = s.performance.reach(0.014, 500.0, 1.0)
    assert after.load_target_n_s_m == pytest.approx(reach.load_n_s_m, rel=1e-12)
    ((code, text),) = events
    assert code == LOAD_RATE_LIMITED
    assert "at 1000 N s/m a second" in text


@pytest.mark.parametrize("power", [100.0, 1400.0])
def test_load_moves_by_no_more_than_its_slew_and_arrives(power):
    c = supervisor(target_power_w=600.0, load_slew_n_s_m_per_s=1000.0)
    s, _ = c.changed(c.initial(), None, power)
    for _ in range(2000):
        after = c.slew(s, 1e-3)
        assert abs(after.load_n_s_m - s.load_n_s_m) <= 1.0 + 1e-9
        s = after
    assert s.load_n_s_m == s.load_target_n_s_m
    assert s.point.fuel_kg == pytest.approx(operating_point(NU, 0.0155, s.load_n_s_m).fuel_kg)
    assert c.slew(s, 1e-3) is s


def test_another_dead_centre_keeps_the_target_power():
    c = supervisor(target_power_w=1200.0)
    s, _ = c.changed(c.initial(), 0.0135, None)
    steady = operating_point(NU, 0.0135, s.load_target_n_s_m)
    assert 0.5 * s.load_target_n_s_m * steady.v_mid_m_s**2 == pytest.approx(1200.0, rel=1e-6)


def test_without_a_target_power_another_dead_centre_keeps_the_load():
    c = supervisor()
    s, events = c.changed(c.initial(), 0.0135, None)
    assert (s.load_target_n_s_m, s.target, events) == (810.0, None, ())


def test_what_the_operator_does_not_name_stays():
    c = supervisor(target_power_w=600.0)
    assert c.changed(c.initial(), None, 500.0)[0].tdc_ref_m == 0.0155


def follow(c, s, delivers, strokes):
    """Let strokes deliver a share of what the load should; returns the set points and events."""
    told = []
    for _ in range(strokes):
        while s.load_n_s_m != s.load_target_n_s_m:
            s = c.slew(s, PERIOD_S)
        power_w = delivers * c.performance.steady(s.tdc_ref_m, s.load_n_s_m).power_w
        s, events = c.regulated(s, power_w, False)
        told += events
    return s, told


@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_the_measured_power_corrects_the_load(scale):
    c = supervisor(target_power_w=1000.0)
    s, told = follow(c, c.initial(), scale, 120)
    delivered = scale * c.performance.steady(s.tdc_ref_m, s.load_n_s_m).power_w
    assert delivered == pytest.approx(1000.0, rel=2e-3)
    assert not told


def test_a_correction_at_its_limit_is_told_once_and_so_is_its_end():
    c = supervisor(target_power_w=1000.0, trim_most=0.1)
    s, told = follow(c, c.initial(), 0.5, 100)
    assert [code for code, _ in told] == [POWER_LIMITED]
    assert "supervisory.trim_most, 0.1" in told[0][1]
    s, told = follow(c, s, 1.0, 200)
    assert [code for code, _ in told] == [POWER_WITHIN_REACH]
    assert s.target.trim < 0.1


def test_what_is_out_of_reach_is_told_and_the_power_within_reach_is_held():
    c = supervisor(target_power_w=1000.0)
    s, events = c.changed(c.initial(), None, 9_000.0)
    assert events[0][0] == POWER_LIMITED
    assert s.target.within_w < 3_500.0
    s, told = follow(c, s, 1.0, 20)
    assert (s.target.within_w, told) == (pytest.approx(s.target.within_w), [])
    _, events = c.changed(s, None, 1_000.0)
    assert events[0][0] == POWER_WITHIN_REACH


def test_strokes_short_of_fuel_take_the_load_back():
    c = supervisor(target_power_w=1000.0)
    s, told = c.initial(), []
    for _ in range(SHORT_STROKES + 3):
        while s.load_n_s_m != s.load_target_n_s_m:
            s = c.slew(s, PERIOD_S)
        s, events = c.regulated(s, 950.0, True)
        told += events
    assert s.target.trim < -0.05
    assert [code for code, _ in told] == [POWER_LIMITED]


def test_a_power_that_is_not_known_changes_nothing():
    c = supervisor(target_power_w=1000.0)
    s = c.initial()
    assert c.regulated(s, None, False) == (s, ())


def test_a_map_says_what_power_needs_which_load():
    given = performance_map(row(0.014, (100.0, 400.0, 600.0)), row(0.016, (200.0, 600.0, 900.0)))
    c = supervisor(target_power_w=800.0, map=given)
    performance = c.performance
    for tdc_m in (0.0135, 0.014, 0.015, 0.016, 0.017):
        assert performance.reach(tdc_m, 800.0, 1.0).load_n_s_m == pytest.approx(400.0)
    beyond = performance.reach(0.015, 5_000.0, 1.0)
    assert beyond.load_n_s_m == pytest.approx(750.0)
    assert beyond.limit == "supervisory.map: the engine stops"
    assert performance.reach(0.015, 10.0, 1.0).load_n_s_m == pytest.approx(150.0)


def test_a_choice_takes_the_row_that_needs_the_least_fuel():
    given = performance_map(
        row(0.014, (100.0, 600.0), efficiency=(0.30, 0.30), throttle=(0.4, 0.9)),
        row(0.015, (100.0, 600.0), efficiency=(0.20, 0.40), throttle=(0.4, 0.9)),
        row(0.016, (100.0, 300.0), efficiency=(0.35, 0.35), throttle=(0.4, 0.9)),
    )
    c = supervisor(target_power_w=300.0, choice="efficiency", map=given)
    best = c.performance.best
    assert best(300.0)[0] == 0.016
    assert best(1100.0) == pytest.approx((0.015, 0.85))
    assert best(1190.0)[0] == 0.015
    assert best(50.0)[0] == 0.014
    s, _ = c.changed(c.initial(), None, 1100.0)
    assert (s.tdc_ref_m, s.throttle) == pytest.approx((0.015, 0.85))
    assert c.changed(s, 0.0145, 1100.0)[0].tdc_target_m == 0.0145


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"power_w": (1.0, 2.0)}, "power_w needs a value for each"),
        ({"power_w": (1.0, 2.0, 2.0)}, "power_w must rise"),
    ],
)
def test_a_row_that_is_no_curve_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        performance_map(row(0.015, (1.0, 2.0, 3.0), **change))


def test_rows_out_of_order_are_refused_and_a_choice_without_a_map():
    with pytest.raises(ValueError, match="tdc_m must rise"):
        performance_map(row(0.015, (1.0, 2.0)), row(0.014, (1.0, 2.0)))
    with pytest.raises(ValueError, match="needs a map"):
        SupervisoryConfig(choice="efficiency")
