"""What must hold of the plant whatever it is told."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.config.plant import LoadScaleEvent, PlantConfig
from hil.values import replace
from hil.wire.pulses import INJECTOR, LONGEST_US, PulseOrder
from plant.build import plant_params
from plant.engines.machine import MachineOrder
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step

MODELS = ("closed-form", "harmonic", "rectangular", "nonlinear")
FUEL = {"nonlinear": 1.95e-6}
SWAP = (1, 0, 3, 2)

orders = st.builds(
    MachineOrder,
    st.integers(0, 2),
    st.floats(-6000.0, 6000.0),
    st.floats(0.0, 10_000.0),
)
# (channel, opening ahead of now, duration)
shots = st.tuples(st.integers(-1, 5), st.integers(-2000, 30_000), st.integers(0, 30_000))
ticks = st.one_of(
    st.none(), st.tuples(st.none() | orders, st.lists(shots, max_size=3), st.integers(1, 30))
)
scripts = st.lists(ticks, max_size=25)
quick = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def play(p, state, script):
    """Yield each state and its events; a script entry lasts a number of ticks."""
    for entry in script:
        order, fired, lasting = entry or (None, [], 3)
        now_us = state.tick * p.period_ns // 1000
        pulses = tuple(PulseOrder(c, (now_us + a) % 2**20, d) for c, a, d in fired)
        command = Command(order, pulses) if entry else None
        for _ in range(lasting):
            state, events = step(p, state, command)
            yield state, events


@pytest.mark.parametrize("model", MODELS)
@given(script=scripts, running=st.booleans(), restitution=st.floats(0.0, 0.95))
@quick
def test_no_command_breaks_the_plant(model, script, running, restitution):
    load = LoadScaleEvent(kind="load-scale", value=0.3, at_s=0.01, at_stroke_fraction=0.7)
    config = PlantConfig(model=model, contact_restitution=restitution)
    p = plant_params(config, 1_000_000, 0, {"load": load})
    start, _ = initial_state(p, FUEL.get(model, 2.8e-6) if running else None)
    for state, events in play(p, start, script):
        assert abs(state.x_m) <= 0.020
        assert abs(state.v_m_s) < 200.0
        assert len(events) < 100
        now_ns = state.tick * p.period_ns
        assert all(now_ns - p.period_ns <= e.t_ns <= now_ns for e in events)
        for line in state.pulses.table.lines:
            if line.open is not None:
                assert now_ns < line.open.close_ns
                assert line.open.close_ns - line.open.open_ns <= LONGEST_US[INJECTOR] * 1000


@pytest.mark.parametrize("model", MODELS)
@given(script=scripts)
@quick
def test_injectors_close_without_being_told(model, script):
    p = plant_params(PlantConfig(model=model), 1_000_000)
    start, _ = initial_state(p)
    state = [start, *(state for state, _ in play(p, start, script))][-1]
    for _ in range(600):
        state, _ = step(p, state, None)
    assert all(line.open is None and line.pending is None for line in state.pulses.table.lines)


@pytest.mark.parametrize("model", MODELS)
@given(script=scripts)
@quick
def test_left_and_right_are_mirror_images(model, script):
    p = plant_params(PlantConfig(model=model), 1_000_000)
    mirrored = [
        entry
        and (
            entry[0] and replace(entry[0], force_n=-entry[0].force_n),
            [(SWAP[c] if 0 <= c < 4 else c, a, d) for c, a, d in entry[1]],
            entry[2],
        )
        for entry in script
    ]
    start, _ = initial_state(p)
    pairs = zip(play(p, start, script), play(p, start, mirrored), strict=True)
    for (a, _), (b, _) in pairs:
        assert a.x_m == pytest.approx(-b.x_m, abs=1e-12)
        assert a.v_m_s == pytest.approx(-b.v_m_s, abs=1e-9)
        assert a.dead_centre.number == b.dead_centre.number


@given(script=scripts, running=st.booleans())
@quick
def test_same_inputs_give_the_same_run(script, running):
    p = plant_params(PlantConfig(), 1_000_000)
    start, _ = initial_state(p, 2.8e-6 if running else None)
    assert list(play(p, start, script)) == list(play(p, start, script))
