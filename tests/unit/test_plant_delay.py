"""Commands that act later than the wire's one tick."""

from hil.config.plant import PlantConfig
from hil.wire.messages import GENERATOR
from plant.build import plant_params
from plant.engines.machine import MachineOrder
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step


def first_tick_with(delay_ticks, load):
    p = plant_params(PlantConfig(command_delay_ticks=delay_ticks), 1_000_000)
    state, _ = initial_state(p, 2.8185e-6)
    command = Command(MachineOrder(GENERATOR, 0.0, load))
    for tick in range(10):
        state, _ = step(p, state, command)
        if state.machine.load_coefficient_n_s_m == load:
            return tick
    return None


def test_a_command_acts_by_the_delay_later():
    assert [first_tick_with(delay, 700.0) for delay in (0, 1, 2)] == [0, 1, 2]


def test_a_command_that_was_lost_is_lost_when_it_would_have_acted():
    p = plant_params(PlantConfig(command_delay_ticks=2), 1_000_000)
    state, _ = initial_state(p, 2.8185e-6)
    state, _ = step(p, state, None)
    assert state.stale == 0
    for _ in range(2):
        state, _ = step(p, state, Command())
    assert state.stale == 1
