"""The loop without wire and log gives the strokes of the loop with both."""

import pytest

import controller.build
import plant.build
from bench.run.offline import simulate
from bench.run.resolve import resolve
from drivers.links import open_memory
from drivers.recorder.client import NullRecorder
from hil.config.load import build
from plant.rig.state import DeadCentre


def scenario(**tree):
    base = {"run": {"duration_s": 0.6}, "loop": {"clock": "lockstep"}}
    return resolve(build(base | tree, "test"))


def over_the_wire(resolved):
    """Dead centres of both loops over a memory link."""
    plant_end, controller_end = open_memory()
    plant_loop = plant.build.make_loop(resolved, plant_end, NullRecorder())
    controller_loop = controller.build.make_loop(resolved, controller_end, NullRecorder())
    plant_end.link.on_send = lambda: controller_loop.turn(controller_end.link.receive())
    found: list[DeadCentre] = []
    tick = 0
    while tick < resolved.ticks:
        before = plant_loop.state.dead_centre.number
        tick = plant_loop.turn(tick)
        if plant_loop.state.dead_centre.number != before:
            found.append(plant_loop.state.dead_centre)
    return found, controller_loop.state.mode.name.lower()


LOAD = {"kind": "load-scale", "value": 0.85, "at_s": 0.2, "at_stroke_fraction": 0.25}


@pytest.mark.parametrize("model", ["closed-form", "harmonic", "rectangular", "nonlinear"])
@pytest.mark.parametrize("events", [{}, {"load": LOAD}], ids=["steady", "load step"])
def test_strokes_are_those_of_the_wire_to_its_resolution(model, events):
    """0.01 um of position and 1 um/s of speed move a fuel pulse by a microsecond at the most."""
    if model == "nonlinear" and events:
        events = {"load": LOAD | {"value": 0.97}}
    resolved = scenario(plant={"model": model}, events=events)
    course = simulate(resolved)
    wired, mode = over_the_wire(resolved)
    assert course.mode == mode == "generating"
    assert len(course.dead_centres) == len(wired)
    for one, other in zip(course.dead_centres, wired, strict=True):
        assert one.x_m == pytest.approx(other.x_m, abs=2e-5)
        assert one.fuel_kg == pytest.approx(other.fuel_kg, abs=6e-9)
        assert one.t_ns == pytest.approx(other.t_ns, abs=200_000)


def test_same_scenario_gives_the_same_course():
    resolved = scenario(events={"eta": {"kind": "efficiency"}})
    assert simulate(resolved) == simulate(resolved)


def test_seed_decides_what_chance_does():
    eta = {"eta": {"kind": "efficiency"}}
    one = simulate(scenario(events=eta, run={"duration_s": 0.6, "seed": 1}))
    two = simulate(scenario(events=eta, run={"duration_s": 0.6, "seed": 2}))
    assert one.dead_centres != two.dead_centres


def test_events_of_the_plant_are_kept_in_their_order():
    course = simulate(scenario(events={"load": LOAD}))
    assert [event.code for event in course.events] == ["disturbance"]
    assert course.events[0].text == "load (load-scale) begins"
