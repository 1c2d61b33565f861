"""From truth to sample: noise, resolution, faults, and the derived signals."""

import statistics

import pytest

from hil.config.plant import PlantConfig, SensorConfig
from hil.randoms import normal_pair, uniform
from hil.values import replace
from hil.wire.commands import read_event
from plant.build import plant_params
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step
from plant.sensors import sample, sensed

FUEL = 2.8185e-6


def params(events=None, **sensors):
    config = PlantConfig(sensors=SensorConfig(**sensors))
    return plant_params(config, 1_000_000, 7, events)


def samples(p, ticks):
    state, found = initial_state(p, FUEL)[0], []
    for _ in range(ticks):
        found.append((state, sample(p, state)))
        state, _ = step(p, state, Command())
    return found


def test_ideal_sensors_tell_the_truth():
    assert all((seen.x_m, seen.v_m_s) == (s.x_m, s.v_m_s) for s, seen in samples(params(), 60))


def test_an_offset_is_added_to_the_truth():
    shifted = samples(params(offset_x_m=1e-3, offset_v_m_s=-0.5), 60)
    assert all((seen.x_m, seen.v_m_s) == (s.x_m + 1e-3, s.v_m_s - 0.5) for s, seen in shifted)


def test_noise_has_its_standard_deviation():
    p = params(noise_x_m=1e-5, noise_v_m_s=1e-2)
    state = initial_state(p, FUEL)[0]
    seen = [sample(p, replace(state, tick=tick)) for tick in range(4000)]
    assert statistics.stdev(s.x_m for s in seen) == pytest.approx(1e-5, rel=0.05)
    assert statistics.stdev(s.v_m_s for s in seen) == pytest.approx(1e-2, rel=0.05)
    assert statistics.mean(s.x_m for s in seen) == pytest.approx(state.x_m, abs=1e-6)


def test_noise_of_a_tick_does_not_depend_on_history():
    assert normal_pair(5, 2, 1000) == normal_pair(5, 2, 1000)
    assert normal_pair(5, 2, 1000) != normal_pair(6, 2, 1000)
    numbers = [uniform(1, 1, n) for n in range(2000)]
    assert statistics.mean(numbers) == pytest.approx(0.5, abs=0.03)
    assert 0.0 <= min(numbers) < max(numbers) < 1.0


def test_resolution_rounds():
    for _, seen in samples(params(resolution_x_m=1e-4, resolution_v_m_s=1e-2), 20):
        assert seen.x_m / 1e-4 == pytest.approx(round(seen.x_m / 1e-4))
        assert seen.v_m_s / 1e-2 == pytest.approx(round(seen.v_m_s / 1e-2))


@pytest.mark.parametrize(
    ("substitute", "value"), [("hold", 0.0), ("value", 0.001), ("offset", 0.002)]
)
@pytest.mark.parametrize("signal", ["x", "v"])
def test_fault_replaces_one_signal_for_its_duration(signal, substitute, value):
    fault = read_event(
        {
            "kind": "sensor-fault",
            "signal": signal,
            "substitute": substitute,
            "value": value,
            "at_stroke_fraction": 0.2,
            "duration_s": 0.004,
        }
    )
    which = 0 if signal == "x" else 1
    found = samples(params({"sick": fault}), 15)
    for tick, (state, seen) in enumerate(found):
        true, told = (state.x_m, state.v_m_s), (seen.x_m, seen.v_m_s)
        assert told[1 - which] == true[1 - which]
        expected = true[which]
        if 6 <= tick <= 9:
            assert state.disturbances.mask == 8
            held = (found[5][0].x_m, found[5][0].v_m_s)[which]
            expected = {"hold": held, "value": value, "offset": true[which] + value}[substitute]
        assert told[which] == expected


def pressures(p, state):
    found = sensed(p, state)
    return found.p_left_pa, found.p_right_pa


def moved(state, **changes):
    return replace(state, motion=replace(state.motion, **changes))


def test_pressures_follow_the_isentropes_and_the_charge():
    p = params()
    state = initial_state(p, FUEL)[0]
    left, right = pressures(p, state)
    near, far = 0.020 + state.x_m, 0.020 - state.x_m
    assert right == pytest.approx(1e5 * (0.020 / far) ** 1.35)
    burnt = FUEL * 44e6 * 0.35 / 5.0**0.35 / (p.engine.constants.area_m2 * 0.020)
    assert left == pytest.approx((1e5 + burnt) * (0.020 / near) ** 1.35)
    at_head = pressures(p, moved(state, x_m=-0.020))
    assert at_head[0] < 1e9


def test_gas_force_of_the_nonlinear_model_is_its_pressures():
    p = plant_params(PlantConfig(model="nonlinear", load_coefficient_n_s_m=0.0), 1_000_000)
    state = initial_state(p, 1.95e-6, 810.0)[0]
    before = state.v_m_s
    p_left, p_right = pressures(p, state)
    after, _ = step(replace(p, dt_s=1e-6), state, Command())
    force = p.engine.constants.area_m2 * (p_left - p_right)
    assert 7.0 * (after.v_m_s - before) / 1e-6 == pytest.approx(force, rel=1e-3)


def test_generator_power_is_c_v_squared():
    p = params()
    state = moved(initial_state(p, FUEL)[0], v_m_s=2.0)
    assert sensed(p, state).electric_power_w == pytest.approx(810.0 * 4.0)
