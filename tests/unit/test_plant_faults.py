"""Faults that an operator orders over the command key while the engine runs."""

import json

import pytest

from bench.run.resolve import resolve
from bench.run.scenarios import read
from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from plant import faults
from plant.build import make_params
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step


def order(**fields):
    return faults.parse(json.dumps(fields).encode(), "desk", 10_000_000, PlantConfig())


def test_a_fault_is_a_scenario_event_that_begins_now():
    event = order(kind="misfire", count=2)
    assert (event.kind, event.number("count"), event.at_s) == ("misfire", 2, 0.01)


@pytest.mark.parametrize("raw", [b"[", b"3", b'{"kind": "start"}', b'{"kind": "set-point"}'])
def test_what_is_for_the_controller_is_left_alone(raw):
    assert faults.parse(raw, "desk", 0, PlantConfig()) is None


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"kind": "load-scale", "value": -1}, "value"),
        ({"kind": "load-scale"}, "value"),
        ({"kind": "misfire", "cuont": 3}, "cuont"),
        ({"kind": "misfire", "at_s": 1.0}, "at_s"),
    ],
)
def test_a_fault_that_is_none_is_refused_by_field_and_origin(fields, told):
    with pytest.raises(ConfigError, match=f"command from desk: .*{told}") as caught:
        order(**fields)
    assert "\n" not in str(caught.value)


def test_an_ordered_load_step_acts_from_the_next_stroke_on():
    scenario = resolve(read("load-decrease"))
    params = make_params(scenario)
    state, _ = initial_state(params, scenario.controller.preset.fuel_kg)
    for _ in range(10):
        state, _ = step(params, state, Command())
    ordered = order(kind="load-scale", value=0.5)
    params = faults.with_fault(params, state.disturbances.next_edge, ordered)
    before = state.machine.load_coefficient_n_s_m
    for _ in range(30):
        state, _ = step(params, state, Command())
    assert state.machine.load_coefficient_n_s_m == pytest.approx(0.5 * before)
    assert params.edges[-1].at_ns > 1e9  # the scenario's own step is still to come
