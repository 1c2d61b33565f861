"""One tick at a time: machine, combustion, rest, contact and the plant's own safe state."""

import math

import pytest

from hil.config.plant import PlantConfig
from hil.config.prototypes import NU
from hil.errors import ConfigError
from hil.log import topics
from hil.log.records import PAYLOAD_OFFSET
from hil.wire.commands import read_event
from hil.wire.messages import GENERATOR, MOTOR, OFF
from hil.wire.pulses import PulseOrder
from plant.build import plant_params
from plant.engines.machine import MachineOrder
from plant.log import pack_skipped
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step

FUEL = 2.8185e-6
MODELS = ("closed-form", "harmonic", "rectangular", "nonlinear")
STARTING_FUEL = {"nonlinear": 1.95e-6}
GENERATE = MachineOrder(GENERATOR, 0.0, 810.0)


def params(model="harmonic", period_ns=1_000_000, events=None, **config):
    return plant_params(PlantConfig(model=model, **config), period_ns, 3, events)


def settled(p):
    return initial_state(p, STARTING_FUEL.get(p.engine.constants.model, FUEL))[0]


def run(p, state, command, ticks):
    events = []
    for _ in range(ticks):
        state, happened = step(p, state, command)
        events += happened
    return state, events


def to_next_dead_centre(p, state, *pulses, order=GENERATE):
    """Give the pulses in the first tick and go on until the next dead centre."""
    number, command, events = state.dead_centre.number, Command(order, pulses), []
    while state.dead_centre.number == number:
        state, happened = step(p, state, command)
        command = Command(order)
        events += happened
    return state, [e.text for e in events if e.code == "misfire"]


def truth_of(state):
    """What the log holds of a state, by name."""
    layout = topics.TRUTH.layout  # /truth is the first record of a tick whose slot has passed
    fields = layout.unpack(pack_skipped(7, 8, 9, state)[PAYLOAD_OFFSET:])
    return dict(zip([field.name for field in layout.fields], fields, strict=True))


SPARK = PulseOrder(3, 23_600, 100)
FED = PulseOrder(1, 2_000, 3_618)


def test_fuel_and_spark_burn_at_the_next_dead_centre():
    p = params()
    state, misfires = to_next_dead_centre(p, settled(p), FED, SPARK)
    assert misfires == []
    assert state.dead_centre.fuel_kg == pytest.approx(2.818e-6)
    assert state.dead_centre.x_m == pytest.approx(0.0155, abs=1e-6)
    assert state.stroke.direction == -1


@pytest.mark.parametrize(
    ("pulses", "text"),
    [
        ((SPARK,), "right: no fuel"),
        ((FED,), "right: no spark"),
        ((FED, PulseOrder(3, 16_000, 100)), "right: early spark"),
        ((FED, PulseOrder(3, 25_200, 100)), "right: no spark"),
        ((FED, PulseOrder(2, 23_600, 100)), "right: no spark"),
        ((PulseOrder(1, 2_000, 998), SPARK), "right: fuel out of range (0.1980 mg)"),
        ((PulseOrder(1, 2_000, 6_802), SPARK), "right: fuel out of range (6.0020 mg)"),
        ((PulseOrder(0, 2_000, 3_618), SPARK), "right: no fuel"),
        ((), "right: no fuel"),
    ],
)
def test_misfire_is_told_with_its_reason(pulses, text):
    p = params()
    state, misfires = to_next_dead_centre(p, settled(p), *pulses)
    assert len(misfires) == 1
    assert misfires[0].startswith(text)
    assert state.dead_centre.fuel_kg == 0.0


@pytest.mark.parametrize("duration_us", [1_000, 6_800])
def test_fuel_at_the_edge_of_the_range_burns(duration_us):
    p = params()
    state, misfires = to_next_dead_centre(p, settled(p), PulseOrder(1, 2_000, duration_us), SPARK)
    assert misfires == []
    assert state.dead_centre.fuel_kg == pytest.approx((duration_us - 800) * 1e-9)


def test_unburnt_fuel_is_gone_at_the_next_dead_centre_of_its_side():
    p = params()
    state, _ = to_next_dead_centre(p, settled(p), FED)
    assert state.pulses.fuel_kg[1] == 0.0


def test_forced_misfires_are_counted_down():
    events = {"dead": read_event({"kind": "misfire", "at_s": 0.01, "count": 1, "cause": "spark"})}
    p = params(events=events)
    state, misfires = to_next_dead_centre(p, settled(p), FED, SPARK)
    assert misfires == ["right: forced, no spark"]
    assert truth_of(state)["disturbance"] == 4
    assert state.disturbances.misfires == 0


@pytest.mark.parametrize("model", MODELS)
def test_engine_at_rest_stays_silent_at_rest(model):
    p = params(model)
    state, _ = initial_state(p)
    after, events = run(p, state, Command(MachineOrder(OFF, 0.0, 0.0)), 1000)
    assert events == []
    assert (after.x_m, after.v_m_s, after.dead_centre) == (0.0, 0.0, state.dead_centre)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("load", [400.0, 810.0, 900.0, 5000.0])
def test_unfired_engine_comes_to_rest_and_says_so_once(model, load):
    p = params(model)
    state, events = run(p, settled(p), Command(MachineOrder(GENERATOR, 0.0, load)), 8000)
    assert not state.moving
    assert [e.code for e in events].count("at-rest") == 1
    assert abs(state.x_m) <= 2e-6
    assert state.dead_centre.number < 30


@pytest.mark.parametrize("model", MODELS)
def test_motor_in_resonance_builds_up_the_swing(model):
    p = params(model)
    state, _ = initial_state(p)
    reached = []
    for _ in range(600):
        force = 60.0 if state.v_m_s >= 0.0 else -60.0
        number = state.dead_centre.number
        state, _ = step(p, state, Command(MachineOrder(MOTOR, force, 0.0)))
        if state.dead_centre.number != number:
            reached.append(abs(state.dead_centre.x_m))
    assert len(reached) > 5
    assert max(reached) > 0.012
    assert reached[:4] == sorted(reached[:4])


def test_motor_force_swings_about_its_equilibrium():
    p = params()
    state, _ = initial_state(p)
    state, events = run(p, state, Command(MachineOrder(MOTOR, 100.0, 0.0)), 60)
    assert [e.code for e in events] == ["in-motion"]
    assert state.dead_centre.x_m == pytest.approx(2 * 100.0 / NU.rest_stiffness_n_m)


def test_motor_force_is_limited_to_the_peak():
    p = params(engine={"peak_force_n": 50.0})
    state, _ = step(p, initial_state(p)[0], Command(MachineOrder(MOTOR, -4000.0, 0.0)))
    assert state.machine.force_n == -50.0


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("model", MODELS[:3])
def test_piston_pressed_against_a_head_comes_to_rest_there(model, restitution):
    p = params(model, contact_restitution=restitution)
    state, events = run(p, initial_state(p)[0], Command(MachineOrder(MOTOR, 4000.0, 0.0)), 3000)
    assert state.x_m == pytest.approx(0.020)
    assert not state.moving
    assert [e.code for e in events].count("at-rest") == 1
    assert state.contacts == [e.code for e in events].count("contact")
    freed, _ = run(p, state, Command(MachineOrder(OFF, 0.0, 0.0)), 20)
    assert freed.moving
    assert freed.x_m < 0.019


def test_silence_leads_to_the_safe_state_and_a_start_leads_out_of_it():
    p = params()
    state = settled(p)
    order = MachineOrder(GENERATOR, 0.0, 400.0)
    pulse = PulseOrder(1, 15_000, 2_000)
    state, _ = step(p, state, Command(order, (pulse, PulseOrder(3, 23_000, 100))))
    state, events = run(p, state, None, 10)
    assert events == []
    assert state.machine.load_coefficient_n_s_m == 400.0
    state, events = run(p, state, None, 1)
    assert [e.code for e in events] == ["safe-state"]
    assert events[0].t_ns == 11_000_000
    assert state.machine.load_coefficient_n_s_m == 810.0
    assert all(line.open is None and line.pending is None for line in state.pulses.table.lines)
    state, events = run(p, state, Command(order), 1)
    assert (events, state.machine.load_coefficient_n_s_m) == ([], 810.0)
    state, _ = run(p, state, Command(order, may_fire=False), 1)
    state, events = run(p, state, Command(order), 1)
    assert [e.code for e in events] == ["safe-state-left"]
    assert state.machine.load_coefficient_n_s_m == 400.0


def test_command_that_may_not_fire_forces_every_line_low():
    p = params()
    state, _ = step(p, settled(p), Command(GENERATE, (PulseOrder(1, 0, 9_000), SPARK)))
    assert state.pulses.table.lines[1].open is not None
    state, events = step(p, state, Command(GENERATE, (PulseOrder(1, 0, 9_000),), may_fire=False))
    assert events == ()
    assert all(line.open is None and line.pending is None for line in state.pulses.table.lines)
    assert state.pulses.fuel_kg[1] == pytest.approx(0.2e-6)


@pytest.mark.parametrize(("order", "then"), [
    (MachineOrder(MOTOR, 300.0, 0.0), GENERATOR), (MachineOrder(GENERATOR, 0.0, 500.0), GENERATOR),
])  # fmt: skip
def test_a_machine_that_motors_brakes_in_a_tick_without_an_answer(order, then):
    p = params()
    state, _ = run(p, settled(p), Command(order, may_fire=False), 3)
    assert state.machine.order == order
    silent, events = run(p, state, None, 1)
    assert (silent.machine.order.mode, list(events)) == (then, [])
    braking = p.load_coefficient_n_s_m if order.mode == MOTOR else 500.0
    assert silent.machine.order.load_coefficient_n_s_m == braking
    again, _ = run(p, silent, Command(order, may_fire=False), 1)
    assert again.machine.order == order


@pytest.mark.parametrize("model", MODELS)
def test_engine_without_commands_ends_at_rest(model):
    p = params(model)
    state, events = run(p, settled(p), None, 3000)
    assert not state.moving
    assert {e.code for e in events} >= {"safe-state", "at-rest"}


def test_nonsense_order_is_refused_and_the_old_one_kept():
    p = params()
    for order in (MachineOrder(3, 0.0, 0.0), MachineOrder(GENERATOR, 0.0, math.nan)):
        state, events = step(p, settled(p), Command(order))
        assert [e.code for e in events] == ["order-refused"]
        assert state.machine.load_coefficient_n_s_m == 810.0


def test_refused_pulse_is_told():
    p = params()
    _, events = step(p, settled(p), Command(GENERATE, (PulseOrder(9, 0, 10),)))
    assert [(e.code, e.text.split(":")[0]) for e in events] == [
        ("pulse-refused", "unknown channel")
    ]


def test_truth_is_flat_and_exact():
    p = params()
    state, _ = to_next_dead_centre(p, settled(p), FED, SPARK)
    row = truth_of(state)
    assert (row["dc_index"], row["contacts"], row["disturbance"]) == (2, 0, 0)
    assert row["dc_t_ns"] == pytest.approx(25_071_600, abs=500)


@pytest.mark.parametrize("period_ns", [0, 9_999, 10_000_001])
def test_period_out_of_range_is_refused(period_ns):
    with pytest.raises(ConfigError, match="period"):
        params(period_ns=period_ns)
