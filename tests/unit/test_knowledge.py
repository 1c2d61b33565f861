"""What the controller believes of its engine: the closed form, backwards."""

import math

import pytest

from controller.knowledge import load_for_power, motoring_force, operating_point
from hil.config.prototypes import BIT, NU
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import harmonic_cycle


def test_thesis_set_point_needs_the_fuel_of_eq_5_60():
    """Eq. 5.60 at 15.5 mm and 810 N s/m: 2.8185 mg and 19.94 Hz."""
    point = operating_point(NU, 0.0155, 810.0)
    assert point.fuel_kg == pytest.approx(2.8185e-6, rel=1e-4)
    assert 0.5 / point.stroke_s == pytest.approx(19.94, abs=0.005)
    assert point.v_mid_m_s == pytest.approx(0.0155 * 2 * math.pi * 19.94, rel=1e-3)


@pytest.mark.parametrize("engine", [NU, BIT], ids=lambda engine: engine.name)
@pytest.mark.parametrize("load", [200.0, 395.0, 810.0, 1500.0])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_operating_point_is_the_inverse_of_the_closed_form(engine, load, share):
    tdc = share * engine.half_stroke_m
    point = operating_point(engine, tdc, load)
    cycle = harmonic_cycle(constants_of(engine, "harmonic"), point.fuel_kg, load)
    assert cycle.tdc_m == pytest.approx(tdc, rel=1e-12)
    assert cycle.v_mid_m_s == pytest.approx(point.v_mid_m_s, rel=1e-12)
    assert 0.5 / cycle.frequency_hz == pytest.approx(point.stroke_s, rel=1e-12)


def test_without_a_load_the_engine_needs_no_fuel():
    point = operating_point(NU, 0.0155, 0.0)
    assert point.fuel_kg == 0.0
    natural = math.sqrt(NU.rest_stiffness_n_m / NU.moving_mass_kg)
    assert math.pi / point.stroke_s == pytest.approx(natural)


@pytest.mark.parametrize("tdc", [0.010, 0.0155, 0.018])
@pytest.mark.parametrize("power", [1.0, 100.0, 1500.0, 4000.0, 10_000.0])
def test_load_for_a_power_delivers_that_power(tdc, power):
    """Mean power of a harmonic motion: c (X omega)^2 / 2."""
    load = load_for_power(NU, tdc, power)
    point = operating_point(NU, tdc, load)
    assert 0.5 * load * point.v_mid_m_s**2 == pytest.approx(power, rel=1e-9)


def test_no_power_needs_no_load():
    assert load_for_power(NU, 0.0155, 0.0) == 0.0


@pytest.mark.parametrize("amplitude", [0.004, 0.0124, 0.014])
@pytest.mark.parametrize(("x", "v"), [(0.0, 0.0), (-0.005, 0.0), (-0.003, 0.2), (0.002, 0.3)])
def test_motoring_force_does_the_work_that_is_lacking(amplitude, x, v):
    """F (X - x) + m v^2 / 2 + k0 x^2 / 2 = k0 X^2 / 2."""
    k0, m = NU.rest_stiffness_n_m, NU.moving_mass_kg
    force = motoring_force(NU, x, v, 1, amplitude)
    have = 0.5 * (m * v * v + k0 * x * x)
    lacking = 0.5 * k0 * amplitude**2 - have
    if amplitude - x > 1e-3:
        assert force == pytest.approx(lacking / (amplitude - x))
    assert motoring_force(NU, -x, -v, -1, amplitude) == pytest.approx(force)


def test_motoring_force_brakes_what_would_go_beyond_its_amplitude():
    assert motoring_force(NU, 0.0, 5.0, 1, 0.0124) < 0.0
    assert motoring_force(NU, 0.015, 0.0, 1, 0.0124) < 0.0
