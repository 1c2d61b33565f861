"""Disturbances of the charge and of slow sensors: scatter, drift, memory, air, pressures."""

import statistics

import pytest

from bench.dev.golden_cases import LOCKSTEP, Case, scenario_for
from bench.studies.performance import Stand
from plant.rig import charges
from plant.rig.step import step
from plant.sensors import sensed


def stand(*changes):
    return Stand(scenario_for(Case("charge", "steady", changes), LOCKSTEP))


def metered(p, count, t_ns=0.0):
    return [charges.metered_kg(p, 2e-6, number, t_ns) for number in range(count)]


def test_an_undisturbed_injection_is_worth_what_flowed():
    assert metered(stand().params, 3, 5e9) == [2e-6] * 3


def test_injections_scatter_with_their_standard_deviation():
    masses = metered(stand(("plant.injector.scatter", 0.03)).params, 4000)
    assert statistics.mean(masses) == pytest.approx(2e-6, rel=2e-3)
    assert statistics.stdev(masses) == pytest.approx(0.03 * 2e-6, rel=0.05)


def test_an_injector_drifts_with_time():
    p = stand(("plant.injector.drift_1_s", 0.01)).params
    assert metered(p, 1, 3e9) == [pytest.approx(1.03 * 2e-6, rel=1e-12)]


def correlation(p, apart):
    etas = [charges.efficiency(p, (0.9, 1.0), number) for number in range(6000)]
    return etas, statistics.correlation(etas[: -apart or None], etas[apart:])


def test_a_cylinder_remembers_its_cycle_before_and_not_the_other_cylinder():
    etas, own = correlation(stand(("plant.disturbance.efficiency_memory", 0.6)).params, 2)
    assert own == pytest.approx(0.6, abs=0.05)
    assert correlation(stand(("plant.disturbance.efficiency_memory", 0.6)).params, 1)[
        1
    ] == pytest.approx(0.0, abs=0.05)
    assert 0.9 <= min(etas) < max(etas) <= 1.0
    assert statistics.mean(etas) == pytest.approx(0.95, abs=2e-3)
    assert statistics.stdev(etas) == pytest.approx(0.1 / 12**0.5, rel=0.06)


@pytest.mark.parametrize(
    ("changes", "share"),
    [
        ((("plant.disturbance.manifold_scale", 0.8),), 0.8),
        ((("plant.disturbance.intake_warmer_k", 30.0),), 298.15 / 328.15),
    ],
)
def test_the_air_follows_manifold_and_temperature(changes, share):
    at, plain = (s.begin().plant for s in (stand(*changes), stand()))
    disturbed = charges.trapped_kg(stand(*changes).params, at)
    assert disturbed == pytest.approx(share * charges.trapped_kg(stand().params, plain), rel=1e-9)


@pytest.mark.parametrize(
    ("signal", "value"), [("power", 500.0), ("p_left", 2.0e5), ("p_right", 3.0e5)]
)
def test_a_fault_of_a_slow_sensor_replaces_that_signal_alone(signal, value):
    fault = {"kind": "sensor-fault", "signal": signal, "substitute": "value", "value": value,
             "at_s": 0.0, "duration_s": 0.02}  # fmt: skip
    here = stand(("events.fault", fault))
    state = here.begin().plant
    for tick in range(30):
        told, true = (
            sensed(here.params, state),
            here.params.engine.sensed(state.motion, state.machine),
        )
        assert told.of(signal) == (value if tick < 20 else true.of(signal))
        assert all(told.of(n) == true.of(n) for n in ("power", "p_left", "p_right") if n != signal)
        state, _ = step(here.params, state, here.begin().command)


def test_a_power_sensor_that_lies_moves_the_load_no_further_than_its_limit():
    fault = {"kind": "sensor-fault", "signal": "power", "substitute": "value", "value": 100.0,
             "at_s": 0.05, "duration_s": 10.0}  # fmt: skip
    here = stand(
        ("events.fault", fault), ("controller.supervisory.target_power_w", 1000.0),
        ("controller.supervisory.trim_most", 0.1),
    )  # fmt: skip
    at, found, why = here.strokes(here.begin(), 40)
    assert not why
    assert at.mind.set_points.target.trim == 0.1
    assert "supervisory.trim_most" in at.mind.set_points.target.in_the_way
    assert found[-1].tdc_m == pytest.approx(15.5e-3, abs=0.1e-3)
