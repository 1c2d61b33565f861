"""Engines behind one protocol: one of three functions will do, and ours agree with their units."""

import math
import shutil

import pytest

from hil import compiled
from hil.config.engine.models import FmuConfig
from hil.config.plant import PlantConfig
from hil.values import replace
from hil.wire.commands import read_event
from hil.wire.messages import GENERATOR, MOTOR
from hil.wire.pulses import PulseOrder
from plant.build import plant_params
from plant.engines import protocol
from plant.engines.machine import MachineOrder
from plant.engines.protocol import Motion, Moved, Sensed, Stop
from plant.rig.beginning import initial_state
from plant.rig.events import AT_REST, IN_MOTION
from plant.rig.state import Command
from plant.rig.step import step

PERIOD_NS = 1_000_000
PUSH = MachineOrder(MOTOR, 500.0, 0.0)
BRAKE = MachineOrder(GENERATOR, 0.0, 600.0)


def drive(params, ticks=500):
    """Push in resonance until a head is struck, then brake to rest; no charge burns."""
    state, events = initial_state(params)
    positions, seen = [], list(events)
    for tick in range(ticks):
        force = math.copysign(500.0, state.v_m_s)
        order = MachineOrder(MOTOR, force, 0.0) if tick < 200 else BRAKE
        state, happened = step(params, state, Command(order))
        positions.append((state.x_m, state.v_m_s))
        seen += happened
    return positions, state, seen


# --- an engine of another hand ----------------------------------------------------------------


class Pendulum(protocol.Engine):
    """x'' = -w^2 x without friction: begin, advance, sensed."""

    OMEGA = 100.0

    def __init__(self):
        super().__init__(810.0, protocol.AT_DEAD_CENTRE)

    def begin(self, _charge, _load):
        return Motion(-0.01, 0.0, 0.0, True, 1, None)

    def advance(self, m, _inputs, ahead):
        left = ahead.dt_s - ahead.used_s
        to_stop = math.pi / self.OMEGA - m.tau_s
        span = min(left, to_stop, max(ahead.due_s - m.tau_s, 0.0))
        tau = m.tau_s + span
        x = -0.01 * m.heading * math.cos(self.OMEGA * tau)
        v = 0.01 * m.heading * self.OMEGA * math.sin(self.OMEGA * tau)
        used = ahead.used_s + span
        t_ns = ahead.start_ns + used * 1e9
        stop = None
        if span == to_stop:
            stop = Stop(t_ns, x, tau, 1, 0, True, None)
        at_due = stop is None and span < left
        moved = Motion(x, v, tau, True, m.heading, None)
        return Moved(moved, t_ns, used, stop, False, at_due, used >= ahead.dt_s)

    def turn(self, m, _machine, _charge, _stop):
        return Motion(m.x_m, 0.0, 0.0, True, -m.heading, None)

    def stroke_s(self, *_):
        return math.pi / self.OMEGA

    def sensed(self, _m, _machine):
        return Sensed(0.0, 0.0, 0.0)


def test_an_engine_of_another_hand_gets_strokes_loads_and_misfires_from_the_rig():
    load = read_event(
        {"kind": "load-scale", "value": 0.5, "at_s": 0.01, "at_stroke_fraction": 0.25}
    )
    params = replace(plant_params(PlantConfig(), PERIOD_NS, 0, {"load": load}), engine=Pendulum())
    state, _ = initial_state(params, 2.8e-6, 810.0)
    seen = []
    for tick in range(100):
        pulses = (PulseOrder(1, 2000, 3800),) if tick == 0 else ()
        state, events = step(params, state, Command(BRAKE if tick else None, pulses))
        seen += [(e.code, e.t_ns) for e in events]
    half_ns = round(math.pi / Pendulum.OMEGA * 1e9)
    assert ("misfire", half_ns) in seen
    assert ("disturbance", int(half_ns * 1.25)) in seen
    assert state.dead_centre.number == 1 + 100_000_000 // half_ns
    assert state.machine.load_coefficient_n_s_m == 300.0


# --- ours, and what we export of them ---------------------------------------------------------


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("model", ["closed-form", "harmonic", "rectangular", "nonlinear"])
def test_every_tick_of_an_exported_unit_has_the_bits_of_our_own_model(model):
    """From rest by motoring against a head, and back to rest: one set of numbers for both."""
    pytest.importorskip("fmpy", reason="needs the extra fmu")
    from fmu_units import ours

    fmu = FmuConfig(like=model).model_dump(exclude={"file"})
    there = PlantConfig(model=f"fmu:{ours(model, 3)}", fmu=fmu)
    own, own_state, own_events = drive(plant_params(PlantConfig(model=model), PERIOD_NS))
    found, state, events = drive(plant_params(there, PERIOD_NS))
    assert own == found
    assert own_state.contacts == state.contacts > 0
    assert [e for e in own_events if e.code in ("contact", "misfire")] == [
        e for e in events if e.code in ("contact", "misfire")
    ]


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_number_that_python_and_c_share_stands_in_python_alone():
    from plant.engines.fast import shared

    text = (compiled.root() / "plant/engines/fmu/source/engine.c").read_text()
    names = [line.split()[1] for line in shared.header().splitlines() if "#define" in line]
    assert all(name in text for name in names)
    for number in ("1.0e-5", "1.0e-14", "1.0e-6", "0.020", "5.0e-4", "1.0e-13"):
        assert number not in text


@pytest.mark.parametrize("model", ["two-stroke", "harmonic"])
def test_every_engine_tells_when_its_piston_sets_off_and_rests(model):
    if model == "two-stroke":
        pytest.importorskip("numba", reason="needs the extra detailed")
    params = plant_params(PlantConfig(model=model), PERIOD_NS)
    state, _ = initial_state(params)
    codes = []
    for tick in range(1500):
        state, events = step(params, state, Command(PUSH if tick < 20 else BRAKE))
        codes += [e.code for e in events]
    assert codes[0] == IN_MOTION
    assert codes[1::2] == [AT_REST] * (len(codes) // 2)
    assert not state.moving
