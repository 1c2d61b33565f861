"""The models' settled motion against closed forms and published figures."""

import math

import pytest
from plant_rig import Rig, make

from hil.config.prototypes import BIT, NU
from hil.errors import ConfigError
from plant.engines.fast.combustion import Burn
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_curve, fuel_for_tdc, limit_cycle
from plant.engines.fast.paths import remaining_s
from plant.rig.beginning import initial_state

NU_FUEL = 2.8185e-6
LINEAR = ("closed-form", "harmonic", "rectangular")


def test_equation_5_60_gives_the_set_point():
    cycle = limit_cycle(constants_of(NU, "harmonic"), NU_FUEL, 810.0)
    assert cycle.tdc_m == pytest.approx(15.5e-3, abs=1e-6)
    assert cycle.frequency_hz == pytest.approx(19.94, rel=1e-3)


def test_rectangular_excitation_has_the_coth_limit_cycle():
    cycle = limit_cycle(constants_of(NU, "rectangular"), NU_FUEL, 810.0)
    assert cycle.tdc_m == pytest.approx(16.684e-3, abs=1e-6)
    assert cycle.frequency_hz == pytest.approx(17.69, rel=1e-3)


@pytest.mark.parametrize(("change", "tdc_mm", "rpm"), [(-0.9, 2.75, 674.0), (0.9, 22.70, 1552.0)])
def test_fuel_curve_reaches_both_ends_of_the_figure(change, tdc_mm, rpm):
    curve = fuel_curve(constants_of(NU, "harmonic"), [NU_FUEL * (1.0 + change)], 810.0)
    assert curve.tdc_m[0] * 1e3 == pytest.approx(tdc_mm, abs=0.005)
    assert curve.speed_rpm[0] == pytest.approx(rpm, rel=1e-3)


@pytest.mark.parametrize(("load", "tdc_mm"), [(1.05, 14.69), (1.0, 15.5), (0.95, 16.65)])
def test_nonlinear_motion_shifts_with_load(load, tdc_mm):
    engine = constants_of(NU, "nonlinear")
    cycle = limit_cycle(engine, fuel_for_tdc(engine, 0.0155, 810.0), 810.0 * load)
    assert cycle.tdc_m * 1e3 == pytest.approx(tdc_mm, abs=0.005)


def test_nonlinear_fuel_and_frequency_at_the_set_point():
    engine = constants_of(NU, "nonlinear")
    fuel_kg = fuel_for_tdc(engine, 0.0155, 810.0)
    assert fuel_kg * 1e6 == pytest.approx(1.950, abs=0.001)
    assert limit_cycle(engine, fuel_kg, 810.0).frequency_hz == pytest.approx(21.6, abs=0.05)


@pytest.mark.parametrize(("fuel", "load"), [(2.8185e-6, 810.0), (1.95e-6, 688.5)])
def test_nonlinear_motion_has_no_cycle_inside_the_stroke(fuel, load):
    with pytest.raises(ConfigError, match="no settled motion"):
        limit_cycle(constants_of(NU, "nonlinear"), fuel, load)


@pytest.mark.parametrize(
    ("model", "fuel_mg"), [("harmonic", 2.8185), ("rectangular", 2.474), ("nonlinear", 1.950)]
)
def test_fuel_for_the_set_point(model, fuel_mg):
    fuel_kg = fuel_for_tdc(constants_of(NU, model), 0.0155, 810.0)
    assert fuel_kg * 1e6 == pytest.approx(fuel_mg, rel=1e-3)


def test_beijing_engine_at_wide_open_throttle():
    cycle = limit_cycle(constants_of(BIT, "harmonic"), BIT.full_throttle_fuel_kg, 395.0)
    assert cycle.frequency_hz == pytest.approx(18.22, rel=1e-3)
    assert cycle.tdc_m * 1e3 == pytest.approx(33.9, abs=0.05)
    params = make(
        "harmonic", BIT.full_throttle_fuel_kg, prototype="bit", engine={"fuel_max_kg": 7e-6}
    )
    rig = Rig(params, BIT.full_throttle_fuel_kg).run(0.5)
    assert rig.tdc_mm() == pytest.approx([cycle.tdc_m * 1e3] * len(rig.dead_centres), abs=1e-6)


@pytest.mark.parametrize("model", [*LINEAR, "nonlinear"])
def test_settled_engine_stays_settled(model):
    engine = constants_of(NU, model)
    fuel_kg = fuel_for_tdc(engine, 0.0155, 810.0)
    cycle = limit_cycle(engine, fuel_kg, 810.0)
    rig = Rig(make(model, fuel_kg), fuel_kg).run(1.0)
    assert rig.tdc_mm() == pytest.approx([15.5] * len(rig.dead_centres), abs=1e-6)
    seconds = (rig.dead_centres[-1].t_ns - rig.dead_centres[0].t_ns) * 1e-9
    strokes = len(rig.dead_centres) - 1
    assert 2.0 * cycle.frequency_hz * seconds == pytest.approx(strokes, abs=1e-4)
    assert rig.events == []


@pytest.mark.parametrize("model", [*LINEAR, "nonlinear"])
def test_mid_stroke_velocity_is_the_cycles(model):
    engine = constants_of(NU, model)
    fuel_kg = fuel_for_tdc(engine, 0.0155, 810.0)
    rig = Rig(make(model, fuel_kg, period_ns=10_000), fuel_kg)
    while rig.state.x_m < 0.0:
        rig.tick(())
    v_mid = rig.state.v_m_s
    assert v_mid == pytest.approx(limit_cycle(engine, fuel_kg, 810.0).v_mid_m_s, rel=3e-3)


def test_small_motion_has_the_linearised_frequency():
    """omega^2 = 2 gamma p0 A / (m Ls): the small-x limit of two isentropes."""
    params = make("nonlinear", NU_FUEL, load_coefficient_n_s_m=0.0)
    state, _ = initial_state(params, None)
    x, k0 = 2e-5, NU.rest_stiffness_n_m
    path = state.motion.inner.path
    half_period = remaining_s(params.engine.constants, Burn(1, 0.0), path, x=-x, v=0.0, tau=0.0)
    assert half_period == pytest.approx(math.pi * math.sqrt(7.0 / k0), rel=1e-5)


def test_nonlinear_cycle_balances_its_energy():
    """Work of the burnt charge over a stroke = c times the integral of v^2 dt."""
    engine = constants_of(NU, "nonlinear")
    fuel_kg = fuel_for_tdc(engine, 0.0155, 810.0)
    rig = Rig(make("nonlinear", fuel_kg, period_ns=20_000), fuel_kg)
    powers = [0.0]
    while len(rig.dead_centres) < 2:
        rig.tick(())
        powers.append(810.0 * rig.state.v_m_s**2)
    dissipated = 2e-5 * sum(powers)
    size, power, x = 0.020, 1.0 - 1.35, 0.0155
    scale = fuel_kg * NU.energy_j_kg * size**0.35 / 0.35
    work = scale * ((size - x) ** power - (size + x) ** power)
    assert dissipated == pytest.approx(work, rel=1e-4)


def test_initial_fuel_outside_the_range_is_refused():
    with pytest.raises(ConfigError, match=r"initial fuel 7 mg"):
        initial_state(make("harmonic", 7e-6), 7e-6)


def test_settled_motion_beyond_the_head_is_refused():
    with pytest.raises(ConfigError, match="strikes the head"):
        initial_state(make("harmonic", 5e-6), 5e-6)
