"""Maps of an engine: they measure what the equations say, and a target power goes by them."""

import pytest

from bench.cli import app
from bench.dev.golden_cases import LOCKSTEP, Case, scenario_for
from bench.studies import performance
from controller.supervision.performance import Performance
from hil.config.prototypes import NU
from hil.config.supervisory.performance import PerformanceMap
from hil.errors import ConfigError
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc, limit_cycle, power_w

STEADY = scenario_for(Case("map", "steady", (("plant.model", "rectangular"),)), LOCKSTEP)


@pytest.fixture(scope="module")
def found():
    performance.LOAD_STEP, before = 1.8, performance.LOAD_STEP
    yield performance.made(STEADY, [0.0165, 0.0155])
    performance.LOAD_STEP = before


def test_a_map_measures_the_settled_motion_of_the_model(found):
    engine = constants_of(NU, "rectangular")
    for row, tdc_m in enumerate(found["tdc_m"]):
        for column, load in enumerate(found["load_n_s_m"][row]):
            fuel_kg = fuel_for_tdc(engine, tdc_m, load)
            cycle = limit_cycle(engine, fuel_kg, load)
            assert found["fuel_kg"][row][column] == pytest.approx(fuel_kg, rel=5e-3)
            assert found["power_w"][row][column] == pytest.approx(
                power_w(engine, fuel_kg, cycle), rel=5e-3
            )
            assert found["stroke_s"][row][column] == pytest.approx(
                0.5 / cycle.frequency_hz, rel=2e-3
            )


def test_a_row_of_a_linear_engine_has_the_efficiency_of_its_work(found):
    """2 E X / Ls of m Hu, with E = m Hu (R / Cv) / CR^(gamma - 1)."""
    for row, tdc_m in enumerate(found["tdc_m"]):
        expected = 2.0 * tdc_m / NU.half_stroke_m * NU.energy_j_kg / NU.heating_value_j_kg
        assert found["efficiency"][row] == [pytest.approx(expected, rel=3e-3)] * len(
            found["load_n_s_m"][row]
        )


def test_a_map_is_kept_with_its_origin_and_found_again(found):
    kept = PerformanceMap.model_validate(found)
    assert (kept.origin.model, kept.origin.prototype) == ("rectangular", "nu")
    changes = (
        ("plant.model", "rectangular"), ("controller.supervisory.map", found),
        ("controller.supervisory.target_power_w", 600.0),
        ("controller.supervisory.choice", "efficiency"),
    )  # fmt: skip
    control = scenario_for(Case("map", "steady", changes), LOCKSTEP).controller
    assert control.tdc_ref_m == 0.0165  # the row with the better efficiency
    reach = Performance(control, NU, 1e-3).reach(0.0155, 3_000.0, 1.0)
    assert reach.limit.startswith("supervisory.map")


@pytest.mark.parametrize("given", ["15,x", ""])
def test_dead_centres_that_are_no_numbers_are_refused(given):
    with pytest.raises(ConfigError, match="accepted are millimetres"):
        performance.run("steady", given, None, [])


def test_an_engine_that_does_not_run_there_is_refused():
    with pytest.raises(ConfigError, match="--tdc 2: at 810 N s/m"):
        performance.made(STEADY, [0.002])


def test_the_command_is_there():
    assert "map" in {command.name for command in app.registered_commands}
