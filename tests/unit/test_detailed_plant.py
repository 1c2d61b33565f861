"""A detailed engine behind the plant's step: pulses, orders, refusals, the closed loop."""

from itertools import pairwise

import numpy as np
import pytest

from bench.run.resolve import resolve
from controller.observe.estimate import Motion
from controller.timing.position import predict
from hil.config.load import build
from hil.config.plant import PlantConfig
from hil.config.prototypes import NU
from hil.errors import ConfigError
from hil.wire.messages import GENERATOR, MOTOR
from hil.wire.pulses import PulseOrder
from plant.build import plant_params
from plant.engines.detailed import layout as at
from plant.engines.machine import MachineOrder
from plant.rig.beginning import initial_state
from plant.rig.events import CONTACT, MISFIRE, PULSE_REFUSED
from plant.rig.state import Command
from plant.rig.step import step
from plant.sensors import sensed

FUEL_KG = 178.8 / 44e6
PERIOD_NS = 1_000_000
LOAD = MachineOrder(GENERATOR, 0.0, 810.0)
CONFIG = PlantConfig(model="two-stroke")


def run(ticks, pulses=(), order=LOAD, settled=True):
    params = plant_params(CONFIG, PERIOD_NS)
    state, _ = initial_state(params, FUEL_KG if settled else None, 810.0)
    seen = []
    for _ in range(ticks):
        state, events = step(params, state, Command(order, tuple(pulses)))
        seen += events
    return state, seen


def p_left_pa(state):
    return sensed(plant_params(CONFIG, PERIOD_NS), state).p_left_pa


def test_settled_run_begins_at_the_left_dead_centre_alight():
    state, _ = run(1)
    assert state.dead_centre.x_m == pytest.approx(-15.64e-3, abs=0.05e-3)
    assert state.x_m > state.dead_centre.x_m
    assert p_left_pa(state) > 20e5


def test_spark_and_fuel_make_a_combustion():
    pulses = [PulseOrder(1, 9000, 4064 + 800), PulseOrder(3, 14_400, 500)]
    params = plant_params(
        PlantConfig(model="two-stroke", injector={"static_flow_kg_s": 1e-3}), PERIOD_NS
    )
    state, _ = initial_state(params, FUEL_KG, 810.0)
    seen = []
    for _ in range(20):
        state, events = step(params, state, Command(LOAD, tuple(pulses)))
        seen += events
    assert state.dead_centre.number == 2
    assert state.dead_centre.fuel_kg == pytest.approx(4.064e-6, abs=2e-9)
    assert [e for e in seen if e.code == MISFIRE] == []


def test_spark_without_fuel_is_a_misfire():
    _, seen = run(20, [PulseOrder(3, 14_400, 500)])
    assert [e.text for e in seen if e.code == MISFIRE] == ["right: no fuel"]


def test_fuel_without_spark_is_a_misfire():
    _, seen = run(20, [PulseOrder(1, 8000, 1800)])
    assert [e.text for e in seen if e.code == MISFIRE] == ["right: no spark"]


def test_spark_without_compression_is_a_misfire():
    _, seen = run(20, [PulseOrder(1, 1000, 1800), PulseOrder(3, 4000, 500)])
    text = next(e.text for e in seen if e.code == MISFIRE)
    assert text.startswith("right: no compression")


def test_same_inputs_give_the_same_state():
    assert run(60)[0] == run(60)[0]


def test_motor_moves_the_piston_from_rest():
    state, seen = run(30, order=MachineOrder(MOTOR, 400.0, 0.0), settled=False)
    assert state.x_m > 5e-3
    assert [e for e in seen if e.code == CONTACT] == []


def test_lost_controller_ends_at_rest():
    params = plant_params(CONFIG, PERIOD_NS)
    state, _ = initial_state(params, FUEL_KG, 810.0)
    for _ in range(3000):
        state, _ = step(params, state, None)
    assert not state.moving
    assert state.v_m_s == 0.0


@pytest.mark.parametrize(
    ("tree", "text"),
    [
        ({"plant": {"model": "four-stroke", "prototype": "bit"}}, "no calibration"),
        ({"plant": {"model": "two-stroke", "engine": {"gamma": 1.3}}}, "gamma: model two-stroke"),
        ({"plant": {"model": "four-stroke"}, "controller": {"name": "cascade"}}, "cycle alone"),
        ({"plant": {"model": "four-stroke", "prototype": "opposed"}}, "no calibration"),
        (
            {"plant": {"model": "two-stroke", "prototype": "opposed"}, "begins": "at-rest"},
            "begins settled",
        ),
        ({"plant": {"model": "starting", "prototype": "nu"}}, "no calibration"),
        ({"plant": {"model": "two-stroke", "load_coefficient_n_s_m": 2000.0}}, "the engine stops"),
    ],
)
def test_what_has_no_engine_is_refused(tree, text):
    with pytest.raises(ConfigError, match=text):
        resolve(build(tree, "test"))


def test_each_model_brings_its_own_defaults():
    two = resolve(build({"plant": {"model": "two-stroke"}}, "test"))
    cold = resolve(build({"plant": {"model": "starting"}}, "test"))
    assert two.controller.open_loop.fuel_kg == pytest.approx(FUEL_KG)
    assert two.controller.tdc_ref_m == pytest.approx(15.64e-3, abs=0.05e-3)
    assert two.controller.timing.spark_position_m == pytest.approx(15e-3)
    assert cold.plant.prototype == "bit"
    assert cold.controller.timing.spark_position_m == pytest.approx(28e-3)


def test_prediction_of_a_braked_mass_before_a_gas_spring():
    """Without gas ahead the way left is v m / c (1 - exp(-c t / m)), which is inverted here."""
    import math

    c, v, way = 810.0 / 7.0, 2.0, 5e-3
    h = 1e-6
    motion = Motion(direction=1, x_m=0.0, v_m_s=v, a_m_s2=-c * v * (1 + 0.5 * c * h))
    reach, _ = predict(NU, motion, h, 810.0, way)
    assert reach == pytest.approx(-math.log(1.0 - way * c / v) / c, rel=1e-3)


def valve_run(pulses, ticks, **config):
    """Step with the same orders in every tick; returns states by tick, and events."""
    params = plant_params(PlantConfig(model="two-stroke", **config), PERIOD_NS)
    state, _ = initial_state(params, FUEL_KG, None)
    states, seen = [], []
    for _ in range(ticks):
        state, events = step(params, state, Command(LOAD, tuple(pulses)))
        states.append(state)
        seen += events
    return states, seen


def opened(state, side, valve):
    d = np.frombuffer(state.motion.inner.d)
    return bool(d[at.CYL + side * at.CYL_STRIDE + valve])


def test_valves_follow_the_piston_while_no_line_is_commanded():
    """Table 3.3: the left exhaust opens 23 mm after the head, the right one is still open then."""
    states, _ = valve_run([], 12)
    for before, after in pairwise(states):
        if before.x_m < 3e-3 <= after.x_m:
            assert (opened(before, 0, at.EXHAUST), opened(after, 0, at.EXHAUST)) == (False, True)


def test_a_valve_follows_its_line_from_its_first_pulse_on():
    """The edges act at their own instants: open from 4.3 ms to 6.6 ms, then closed for good."""
    states, seen = valve_run([PulseOrder(5, 4300, 2300)], 40)
    assert {e.code for e in seen} <= {MISFIRE}
    levels = [opened(state, 0, at.EXHAUST) for state in states]
    assert levels[:8] == [False, False, False, False, True, True, False, False]
    assert not any(levels[7:])


def test_an_early_exhaust_edge_lets_the_charge_out():
    late, _ = valve_run([], 8)
    early, _ = valve_run([PulseOrder(5, 2250, 4000)], 8)
    assert p_left_pa(early[1]) == p_left_pa(late[1])
    assert p_left_pa(early[3]) < 0.7 * p_left_pa(late[3])


def test_an_edge_acts_between_two_ticks():
    """The earlier, the more has left by the tick: three instants inside one tick."""
    found = [
        p_left_pa(valve_run([PulseOrder(5, open_us, 4000)], 4)[0][3])
        for open_us in (3600, 3750, 3900)
    ]
    assert found[0] < found[1] < found[2]


def test_lines_in_step_with_the_piston_change_nothing():
    """Pulses at the instants at which the piston would open and close give the same motion."""
    states, _ = valve_run([], 30)
    alone = states[-1].dead_centre
    edges = crossings_us()
    driven, seen = valve_run(edges, 30)
    assert [e for e in seen if e.code == PULSE_REFUSED] == []
    assert driven[-1].dead_centre.x_m == pytest.approx(alone.x_m, abs=20e-6)


def crossings_us():
    """Valve pulses of the first stroke, from where the piston passes the places of Table 3.3."""
    from hil.config.detailed import read
    from plant.engines.detailed.engine import Motion, begin, engine_of
    from plant.engines.detailed.settle import settle
    from plant.engines.detailed.solver import advance, scratch

    c = read("nu-two-stroke")
    found = settle(c, FUEL_KG, 810.0)
    engine = engine_of(c, self_timed=False)
    motion = Motion(found.y.copy(), found.d.copy(), np.zeros((8, at.N_REC)))
    begin(engine, motion, 1)
    places = {5: 3e-3, 4: 8e-3}  # opening of the left exhaust and intake
    instants = {}
    for n in range(1, 1400):
        x = motion.y[at.X]
        advance(
            engine.p, motion.d, motion.y, engine.programme, scratch(), motion.record, n * 1e-5, True
        )
        for channel, place in places.items():
            if x < place <= motion.y[at.X]:
                instants[channel] = n * 10 - 5
    return [PulseOrder(channel, open_us, 16_000) for channel, open_us in instants.items()]


def test_an_engine_with_ports_has_no_valve_lines():
    _, seen = valve_run([PulseOrder(5, 4300, 2300)], 3, prototype="bit")
    assert {e.code for e in seen} == {PULSE_REFUSED}
    assert "unknown channel" in seen[0].text


def test_a_lost_controller_closes_the_valves_it_has_opened():
    params = plant_params(CONFIG, PERIOD_NS)
    state, _ = initial_state(params, FUEL_KG, 810.0)
    pulses = (PulseOrder(5, 3000, 60_000),)
    for tick in range(30):
        state, _ = step(params, state, Command(LOAD, pulses) if tick < 6 else None)
    assert not opened(state, 0, at.EXHAUST)


def test_engines_with_one_chamber_are_not_for_the_fast_models():
    with pytest.raises(ConfigError, match=r"accept it: two-stroke$"):
        build({"plant": {"model": "harmonic", "prototype": "gas-spring"}}, "test")
