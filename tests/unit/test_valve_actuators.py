"""Valves of the plant between line and gas: delay, spread, what is told, what is struck."""

import numpy as np
import pytest

from bench.run.resolve import resolve
from hil.config.load import build
from hil.config.plant import ValvesConfig
from hil.errors import ConfigError
from hil.wire.messages import EXHAUST_RIGHT, INTAKE_LEFT
from hil.wire.pulses import Edge, Pulse, PulseOrder
from plant.rig import valves
from plant.rig.valves import UNUSED

LIFT_M = 4e-3
PULSE = Pulse(PulseOrder(INTAKE_LEFT, 0, 1), 0, 1000)


def actuators_of(exhaust_late_s=0.0, seed=1, **valves_config):
    return valves.actuators_of(ValvesConfig(**valves_config), seed, LIFT_M, exhaust_late_s)


def edge(t_ns, is_high, channel=INTAKE_LEFT):
    return Edge(t_ns, channel, is_high, PULSE)


def test_a_valve_moves_its_delay_after_the_edge_and_is_told_once():
    actuators = actuators_of(opening_delay_s=3e-3, closing_delay_s=2e-3)
    v = valves.ordered(UNUSED, actuators, edge(1_000_000, True))
    assert v.next_ns == 4_000_000
    assert valves.moved(v, 3_999_999.0) is v
    v = valves.moved(v, 4_000_000.0)
    assert v.levels == (1, -1, -1, -1)
    assert [(m.name, m.t_ns, m.is_open) for m in v.told] == [("intake_left", 4_000_000, True)]
    v = valves.moved(
        valves.ordered(valves.after_telling(v), actuators, edge(9_000_000, False)), 2e7
    )
    assert [(m.t_ns, m.is_open) for m in v.told] == [(11_000_000, False)]


@pytest.mark.parametrize(
    ("channel", "is_high", "late_ns"),
    [(EXHAUST_RIGHT, True, 5_000_000), (EXHAUST_RIGHT, False, 2_000_000),
     (INTAKE_LEFT, True, 3_000_000)],
)  # fmt: skip
def test_a_late_exhaust_valve_opens_late_and_closes_in_time(channel, is_high, late_ns):
    actuators = actuators_of(2e-3, opening_delay_s=3e-3, closing_delay_s=2e-3)
    assert valves.ordered(UNUSED, actuators, edge(0, is_high, channel)).next_ns == late_ns


def test_a_pulse_that_is_over_before_the_valve_has_begun_does_not_open_it():
    actuators = actuators_of(opening_delay_s=8e-3, closing_delay_s=2e-3)
    v = valves.ordered(UNUSED, actuators, edge(1_000_000, True))
    v = valves.moved(valves.ordered(v, actuators, edge(2_000_000, False)), 2e7)
    assert v.levels[0] == 0
    assert [m.is_open for m in v.told] == [False]


def test_delays_spread_as_configured_and_never_lead_their_edge():
    actuators = actuators_of(seed=3, kind="pneumatic", opening_delay_s=0.5e-3)
    v, delays = UNUSED, []
    for number in range(2000):
        t_ns = number * 100_000_000
        v = valves.ordered(v, actuators, edge(t_ns, number % 2 == 0, EXHAUST_RIGHT))
        delays.append(v.moves[-1].t_ns - t_ns)
        v = valves.moved(v, v.next_ns + 1.0)
    opening, closing = np.array(delays[::2]), np.array(delays[1::2])
    assert np.mean(closing) == pytest.approx(8e6, rel=0.01)
    assert np.std(closing) == pytest.approx(0.25e6, rel=0.1)
    assert min(opening) >= 0


@pytest.mark.parametrize(("gap_m", "struck"), [(0.6e-3, 0), (0.4e-3, 1)])
def test_an_open_valve_is_struck_nearer_than_its_lift_less_the_pocket(gap_m, struck):
    actuators = actuators_of(pocket_m=3.5e-3)
    v = valves.moved(valves.ordered(UNUSED, actuators, edge(0, True)), 1.0)
    assert valves.strike(v, actuators, (gap_m, 0.03)) == struck
    assert valves.strike(v, actuators, (0.03, gap_m)) == 0


@pytest.mark.parametrize(
    ("model", "prototype"),
    [("harmonic", "nu"), ("two-stroke", "bit"), ("four-stroke", "mechanical-spring")],
)
def test_an_engine_without_valves_of_its_own_is_refused(model, prototype):
    tree = {
        "plant": {"model": model, "prototype": prototype}, "begins": "settled",
        "controller": {"timing": {"valves": "controller"}}, "run": {"duration_s": 0.1},
    }  # fmt: skip
    with pytest.raises(ConfigError, match=r"controller\.timing\.valves.*accepted.*programme"):
        resolve(build(tree, "test"))
