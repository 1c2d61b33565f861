"""The air of a charge: throttle, manifold, lambda, and what it lets burn (thesis eq. 5.28)."""

import math

import pytest

from bench.dev.golden_cases import LOCKSTEP, Case, scenario_for
from bench.studies.performance import Stand
from hil.config.plant import AirConfig
from hil.config.prototypes import BIT, NU
from plant.rig import air

LIMITED = ("plant.air.limit", True)
MUCH = ("controller.supervisory.target_power_w", 5000.0)


def stand(*changes):
    return Stand(scenario_for(Case("air", "steady", changes), LOCKSTEP))


def after(strokes, *changes):
    """Both loops after so many strokes, the last stroke, and why they were fewer."""
    here = stand(*changes)
    at, found, why = here.strokes(here.begin(), strokes)
    return at, found[-1] if found else None, why


@pytest.mark.parametrize(("engine", "most_mg"), [(NU, 4.06), (BIT, None)])
def test_a_full_charge_is_that_of_the_engines_manifold(engine, most_mg):
    """m_fuel = p V / (R T AFR): 4.06 mg at the 1.3 bar of Table 3.2."""
    intake = air.intake_of(AirConfig(), engine)
    full_kg = intake.full_pa * intake.air_kg_pa / engine.air_fuel_ratio
    expected = engine.full_throttle_fuel_kg * engine.intake_pa / engine.p0_pa
    assert full_kg == pytest.approx(expected, rel=1e-12)
    if most_mg is not None:
        assert full_kg * 1e6 == pytest.approx(most_mg, abs=0.005)


def test_the_manifold_follows_the_throttle_with_its_lag():
    intake = air.intake_of(AirConfig(lag_s=0.04), NU)
    m = air.moved(air.still(intake, 1.0), 0.5, intake.full_pa, 1_000_000_000)
    assert m.pressure_pa(1_000_000_000) == intake.full_pa
    fallen = (m.pressure_pa(1_040_000_000) - 0.5 * intake.full_pa) / (0.5 * intake.full_pa)
    assert fallen == pytest.approx(math.exp(-1.0), rel=1e-12)


def test_lambda_is_one_at_the_limit_of_the_air():
    at, stroke, why = after(30, LIMITED, MUCH, ("controller.supervisory.fuel_reserve", 0.0))
    assert not why
    assert at.plant.dead_centre.lambda_ratio == pytest.approx(1.0, abs=0.02)
    assert stroke.lambda_ratio == pytest.approx(at.plant.dead_centre.lambda_ratio, rel=2e-3)
    assert stroke.tdc_m == pytest.approx(15.5e-3, abs=0.05e-3)
    assert "the air of a charge" in at.mind.set_points.target.in_the_way


def test_half_the_throttle_has_half_the_fuel_and_its_power_by_the_equations():
    """P = 2 f W with W ~ m_fuel (eq. 5.36): half the fuel, and a speed that is lower, too."""
    powers, fuels, speeds = [], [], []
    for throttle in (1.0, 0.5):
        at, stroke, _ = after(30, LIMITED, MUCH, ("controller.supervisory.throttle", throttle))
        assert at.plant.manifold.p_pa == pytest.approx(throttle * NU.intake_pa)
        powers.append(stroke.power_w)
        fuels.append(stroke.demand.fuel_kg)
        speeds.append(stroke.speed_hz)
    assert fuels[1] / fuels[0] == pytest.approx(0.5, rel=5e-3)
    assert powers[1] / powers[0] == pytest.approx(0.5 * speeds[1] / speeds[0], rel=1e-2)


def test_fuel_beyond_the_air_does_not_burn():
    at, _, why = after(
        6, LIMITED, ("controller.name", "open-loop"), ("controller.open_loop.fuel_kg", 4.5e-6),
        ("controller.air.limit", False), ("controller.preset.fuel_kg", 2.8185e-6),
    )  # fmt: skip
    assert not why
    dc = at.plant.dead_centre
    assert dc.lambda_ratio == pytest.approx(4.058 / 4.5, rel=2e-3)
    assert dc.fuel_kg * 1e6 == pytest.approx(4.058, rel=1e-3)


def test_a_mixture_that_is_too_lean_is_a_misfire_and_says_so():
    _, _, why = after(6, LIMITED, ("controller.supervisory.target_power_w", 700.0))
    assert "too lean (lambda 2." in why


def test_the_throttle_follows_the_fuel_to_its_lambda():
    at, stroke, why = after(
        40, LIMITED, ("controller.supervisory.target_power_w", 700.0),
        ("controller.air.lambda_ref", 1.2),
    )  # fmt: skip
    assert not why
    assert stroke.lambda_ratio == pytest.approx(1.2, rel=0.02)
    assert stroke.power_w == pytest.approx(700.0, rel=0.02)
    assert at.mind.set_points.throttle < 0.6


def test_without_the_limit_more_burns_than_there_is_air_for_as_in_the_thesis():
    at, stroke, why = after(30, ("controller.supervisory.target_power_w", 3000.0))
    assert not why
    assert stroke.demand.fuel_kg > 4.3e-6
    assert at.plant.dead_centre.lambda_ratio < 0.95
