"""A target power in the closed loop: begun settled, held under a changed load, limited by name."""

import math
from functools import reduce

import pytest

import controller.build
import controller.step
import plant.build
from bench.dev.golden_cases import LOCKSTEP
from bench.run import scenarios
from bench.run.offline import command_of
from bench.run.resolve import resolve
from controller.state import Inputs
from hil.config.load import build, with_override
from hil.config.prototypes import NU
from hil.toml import read_toml
from hil.wire.messages import PistonSample
from plant.rig.state import Command
from plant.rig.step import step
from plant.sensors import sample, sensed


def run(duration_s, **changes):
    """Run `steady`; returns the finished strokes and the controller's events."""
    given = {"run.duration_s": duration_s, **dict(LOCKSTEP)}
    given |= {key.replace("__", "."): value for key, value in changes.items()}
    tree = reduce(
        lambda t, c: with_override(t, *c), given.items(), read_toml(scenarios.find("steady"))
    )
    scenario = resolve(build(tree, "test"))
    params = plant.build.make_params(scenario)
    state, _ = plant.build.begin(scenario, params)
    law = controller.build.make_params(scenario.controller, NU, scenario.loop.period_ns)
    mind, command = controller.build.initial_state(law), Command()
    schedule = controller.build.schedule_of(scenario)
    strokes, events = [], []
    for tick in range(scenario.ticks):
        seen = sample(params, state)
        power_w = (
            float(round(sensed(params, state).electric_power_w)) if tick % 2 == 0 else math.nan
        )
        state, _ = step(params, state, command)
        inputs = Inputs(tick, PistonSample(seen.x_m, seen.v_m_s), schedule.get(tick), power_w)
        mind, output = controller.step.step(law, mind, inputs)
        command = command_of(output)
        events += output.events
        if output.stroke is not None:
            strokes.append(output.stroke)
    return strokes, events


def mean_w(strokes):
    return sum(stroke.power_w for stroke in strokes) / len(strokes)


MODELS = ("harmonic", "rectangular", "nonlinear", "closed-form")


@pytest.mark.parametrize("model", MODELS)
def test_a_run_begins_settled_at_its_target_power(model):
    strokes, events = run(0.3, plant__model=model, controller__supervisory__target_power_w=1000.0)
    for stroke in strokes[1:]:
        assert stroke.power_w == pytest.approx(1000.0, rel=0.01)
        assert stroke.tdc_m == pytest.approx(15.5e-3, abs=0.05e-3)
    assert not events


@pytest.mark.parametrize("scale", [0.85, 1.15])
@pytest.mark.parametrize("model", ["rectangular", "nonlinear"])
def test_the_power_is_held_under_another_load(model, scale):
    load = {"kind": "load-scale", "value": scale, "at_s": 0.1}
    strokes, _ = run(
        2.4, plant__model=model, controller__supervisory__target_power_w=1000.0, events__load=load
    )
    assert mean_w(strokes[-10:]) == pytest.approx(1000.0, rel=0.02)


@pytest.mark.parametrize(
    ("model", "limit"), [("harmonic", "time to inject"), ("rectangular", "fuel_max_kg")]
)
def test_more_than_the_engine_can_deliver_is_told_with_its_limit(model, limit):
    strokes, events = run(0.5, plant__model=model, controller__supervisory__target_power_w=5000.0)
    ((code, text),) = events
    assert code == "power-limited"
    assert text.startswith("5000 W asked")
    assert limit in text
    assert mean_w(strokes[1:]) == pytest.approx(strokes[-1].power_ref_w, rel=0.01)


def test_another_dead_centre_keeps_the_power():
    move = {"kind": "set-point", "tdc_ref_m": 0.0142, "at_s": 0.1}
    strokes, _ = run(1.2, controller__supervisory__target_power_w=1200.0, events__tdc=move)
    assert strokes[-1].tdc_m == pytest.approx(14.2e-3, abs=0.05e-3)
    assert mean_w(strokes[-10:]) == pytest.approx(1200.0, rel=0.02)


def test_the_speed_is_that_of_the_strokes():
    strokes, _ = run(0.3)
    assert strokes[0].speed_hz is None
    assert strokes[-1].speed_hz == pytest.approx(19.943, rel=1e-3)
