"""The stroke's map: exact for the linear engines, and each of its inverses inverts it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.studies.bound import LoadChange, stroke_end
from controller.knowledge import OperatingPoint
from controller.motion.calibration import calibrate
from controller.motion.maps.gas_law import GasMap
from hil.config.motion.stroke_map import StrokeMapConfig
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
    found = calibrate(
        StrokeMapConfig(), prototype, prototype.tdc_ref_m, prototype.load_coefficient_n_s_m, point
    )
    return engine, point, found


@pytest.mark.parametrize("prototype", [NU, BIT])
@pytest.mark.parametrize(("model", "shape"), [("harmonic", 1.0), ("rectangular", 0.0)])
def test_calibration_finds_the_excitation_from_the_steady_state_alone(prototype, model, shape):
    _, _, found = map_of(prototype, model)
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


@pytest.mark.parametrize("prototype", [NU, BIT])
@pytest.mark.parametrize("load", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("fuel", [0.9, 1.0, 1.1])
def test_a_stroke_of_the_gas_law_ends_where_the_plant_says(prototype, load, fuel):
    """From its dead centre and from any point behind it, to 2 um and 5 us."""
    engine, point, found = map_of(prototype, "nonlinear")
    ref, c = 1.02 * prototype.tdc_ref_m, load * prototype.load_coefficient_n_s_m
    q = fuel * point.fuel_kg
    plant = stroke_end(engine, ref, q, (LoadChange(0.0, c),))
    end, seconds = found.travel(q, c, -ref, 0.0, 0.0)
    assert end == pytest.approx(plant.tdc_m, abs=2e-6)
    assert seconds == pytest.approx(plant.duration_s, abs=5e-6)
    path = found.path(q, c)
    z, v = -ref, 0.0
    for part in range(1, 20):
        h = plant.duration_s / 24.0
        z, v = path.moved(z, v, h)
        end, left = found.travel(q, c, z, v, part * h)
        assert end == pytest.approx(plant.tdc_m, abs=6e-6)
        assert part * h + left == pytest.approx(plant.duration_s, abs=2e-5)


def test_a_nonlinear_engine_has_the_gas_law_with_the_figures_of_its_prototype():
    _, point, found = map_of(NU, "nonlinear")
    assert isinstance(found, GasMap)
    assert found.spring == pytest.approx(NU.p0_pa * NU.area_m2 * NU.half_stroke_m**NU.gamma, 1e-4)
    assert found.speed == pytest.approx(1.0, abs=1e-4)
    v_mid, _ = found.pass_mid(point.fuel_kg, LOAD, REF)
    assert v_mid == pytest.approx(point.v_mid_m_s, rel=1e-4)


@pytest.mark.parametrize("model", ["harmonic", "rectangular", "nonlinear"])
def test_a_tick_is_predicted_as_it_comes(model):
    """Velocity a tick on, with its slopes over load and charge by differences."""
    _, point, found = map_of(NU, model)
    q, dt = point.fuel_kg, 1e-3

    z0, v0 = -REF, 0.0
    n = 400
    for k in range(n):  # to 8 ms, by the map's own speed
        z0 += 8e-3 / n * found.speed_at(q, LOAD, REF, 8e-3 * (k + 0.5) / n)
    v0, middle, v1 = (found.speed_at(q, LOAD, REF, tau) for tau in (8e-3, 8.5e-3, 9e-3))
    z1 = z0 + dt * (v0 + 4.0 * middle + v1) / 6.0
    told = found.predict(q, LOAD, dt, z0, v0, z1, v1, 9e-3)
    assert told.v_m_s == pytest.approx(v1, abs=2e-4)
    more = found.predict(q, 1.01 * LOAD, dt, z0, v0, z1, v1, 9e-3).v_m_s
    assert told.by_load == pytest.approx((more - told.v_m_s) / (0.01 * LOAD), rel=1e-6)
    more = found.predict(1.01 * q, LOAD, dt, z0, v0, z1, v1, 9e-3).v_m_s
    # That the sine runs faster with more charge is left out of the harmonic slope.
    close = 0.15 if model == "harmonic" else 0.02
    assert told.by_charge == pytest.approx((more - told.v_m_s) / (0.01 * q), rel=close)


def test_without_fuel_or_load_there_is_nothing_to_calibrate_on():
    assert calibrate(StrokeMapConfig(), NU, REF, LOAD, OperatingPoint(0.0, 1.9, 0.025)) is None
    assert calibrate(StrokeMapConfig(), NU, REF, 0.0, OperatingPoint(2.8e-6, 1.9, 0.025)) is None


MAPS = [map_of(NU, model)[2] for model in ("harmonic", "rectangular", "nonlinear")]


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
