"""The stroke's map: exact for the linear engines, and each of its inverses inverts it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.studies.bound import LoadChange, stroke_end
from controller.knowledge import OperatingPoint
from controller.motion.calibration import calibrate
from hil.config.prototypes import BIT, NU
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc, limit_cycle

LOAD, REF = 810.0, 0.0155


def point_of(prototype, model):
    engine = constants_of(prototype, model)
    ref, load = prototype.tdc_ref_m, prototype.load_coefficient_n_s_m
    fuel = fuel_for_tdc(engine, ref, load)
    cycle = limit_cycle(engine, fuel, load)
    return engine, OperatingPoint(fuel, cycle.v_mid_m_s, 0.5 / cycle.frequency_hz)


def map_of(prototype, model):
    engine, point = point_of(prototype, model)
    found = calibrate(prototype, prototype.tdc_ref_m, prototype.load_coefficient_n_s_m, point)
    return engine, point, found


@pytest.mark.parametrize("prototype", [NU, BIT])
@pytest.mark.parametrize(("model", "shape"), [("harmonic", 1.0), ("rectangular", 0.0)])
def test_calibration_finds_the_excitation_from_the_steady_state_alone(prototype, model, shape):
    _, _, found = map_of(prototype, model)
    assert found.fits
    assert found.h == pytest.approx(shape, abs=1e-4)
    assert found.k0 == pytest.approx(prototype.rest_stiffness_n_m, rel=1e-4)


@pytest.mark.parametrize("model", ["harmonic", "rectangular"])
@pytest.mark.parametrize("load", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("fuel", [0.85, 1.0, 1.15])
def test_a_whole_stroke_ends_where_the_plant_says(model, load, fuel):
    engine, point, found = map_of(NU, model)
    q, c, start = fuel * point.fuel_kg, load * LOAD, 1.03 * REF
    plant = stroke_end(engine, start, q, (LoadChange(0.0, c),))
    end, seconds = found.travel(q, c, -start, 0.0, 0.0)
    assert end == pytest.approx(plant.tdc_m, abs=2e-8)
    assert seconds == pytest.approx(plant.duration_s, abs=3e-6)


def test_an_engine_of_another_kind_is_met_in_tdc_and_stroke_and_said_so():
    _, point, found = map_of(NU, "nonlinear")
    assert not found.fits
    assert found.end_of(point.fuel_kg, LOAD, REF) == pytest.approx(REF, rel=1e-5)
    v_mid, _ = found.pass_mid(point.fuel_kg, LOAD, REF)
    assert v_mid * found.speed == pytest.approx(point.v_mid_m_s, rel=1e-5)


def test_without_fuel_or_load_there_is_nothing_to_calibrate_on():
    assert calibrate(NU, REF, LOAD, OperatingPoint(0.0, 1.9, 0.025)) is None
    assert calibrate(NU, REF, 0.0, OperatingPoint(2.8e-6, 1.9, 0.025)) is None


MAPS = [map_of(NU, "harmonic")[2], map_of(NU, "rectangular")[2]]


@given(
    engine=st.sampled_from(MAPS),
    load=st.floats(600.0, 1000.0),
    start=st.floats(0.013, 0.017),
    target=st.floats(0.013, 0.017),
)
def test_the_charge_for_a_target_reaches_it(engine, load, start, target):
    q = engine.charge_for(load, start, target, 2.6e-6)
    assert engine.end_of(q, load, start) == pytest.approx(target, abs=2e-6)


@given(
    engine=st.sampled_from(MAPS),
    load=st.floats(600.0, 1000.0),
    q=st.floats(2.0e-6, 3.5e-6),
    start=st.floats(0.013, 0.017),
)
def test_the_load_behind_a_mid_stroke_speed_is_the_one_that_made_it(engine, load, q, start):
    v_mid, _ = engine.pass_mid(q, load, start)
    assert engine.load_behind(q, start, v_mid, LOAD) == pytest.approx(load, rel=2e-3)


@given(engine=st.sampled_from(MAPS), load=st.floats(650.0, 950.0))
def test_the_load_of_a_cycle_is_the_one_that_it_was_found_with(engine, load):
    q = engine.charge_for(load, REF, REF, 2.6e-6)
    assert engine.load_of_cycle(q, REF, LOAD) == pytest.approx(load, rel=1e-3)
