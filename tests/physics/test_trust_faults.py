"""Sensors that lie and actuators that fail, at phases of a stroke: no contact, each is named."""

import pytest
from test_trust_losses import phases, rig_of, turn_for

from bench.trust.faults import (
    ACTUATOR_FAULTS,
    SENSOR_FAULTS,
    apply_actuator,
    apply_sensor,
)
from controller.mode.start_restart import Mode

PHASES = 8
BRIDGED = {"x jumps 20 mm for 5 ticks", "x jumps -20 mm for 5 ticks", "x jumps 5 mm for 5 ticks",
           "x stuck for 5 ms", "v stuck for 5 ms"}  # fmt: skip
"""What lasts so little that the engine may go on; where it does, it was only told."""

INTERMITTENT = {"v jumps 5 m/s for 5 ticks", "every third v wild", "every fifth sample nought"}
"""What is left out as long as the rest is enough."""

BORNE = {"left injector open half as long", "both injectors open half as long",
         "left injector open 1.2 times as long", "machine brakes double",
         "machine generates at full load", "right spark 4 ms early"}  # fmt: skip
"""What the law and the restart make up for: no stroke of it is lost for good. An early spark finds
compression enough, and what its place does to the work is off by default."""

BEGINS = {"generating": ("steady", 0.3, 0.0502, 0.050), "motoring": ("start", 0.15, 0.1, 0.110)}
"""Scenario, begin and span of the phases, and by when a fault is told: two strokes of the mode."""


def named(rig):
    return [told for told in rig.told if told.code in {"mode safe", "sample-doubted"}]


@pytest.fixture(scope="module", params=BEGINS)
def begun(request):
    scenario, begin_s, span_s, within_s = BEGINS[request.param]
    rig = rig_of(scenario)
    return rig, phases(rig, begin_s, span_s, PHASES), within_s


@pytest.mark.parametrize("fault", SENSOR_FAULTS, ids=lambda fault: fault.name)
def test_a_sensor_that_lies_strikes_no_head_and_is_named(begun, fault):
    rig, memories, within_s = begun
    for memory in memories:
        rig.recall(memory)
        motion = rig.plant.state.motion
        apply_sensor(rig, fault, (motion.x_m, motion.v_m_s))
        turn_for(rig, within_s)
        in_time = rig.is_controller_safe
        turn_for(rig, 0.35)
        assert rig.contacts == 0
        if fault.name not in BRIDGED:
            assert named(rig)
            assert in_time or fault.name in INTERMITTENT
            assert not any("sample lost" in told.text for told in named(rig))


@pytest.mark.parametrize(
    "fault", [f for f in ACTUATOR_FAULTS if not f.forces], ids=lambda fault: fault.name
)
def test_an_actuator_that_fails_strikes_no_head_and_ends_in_a_named_fault(fault):
    rig = rig_of()
    for memory in phases(rig, 0.3, 0.0502, 4):
        rig.recall(memory)
        apply_actuator(rig, fault)
        turn_for(rig, 0.6)
        assert rig.contacts == 0
        if fault.name not in BORNE:
            assert rig.controller.state.mode is Mode.SAFE
            text = next(t.text for t in rig.told if t.code == "mode safe")
            assert "does not fire" in text or "misfires" in text


def test_a_machine_that_does_not_brake_is_named():
    rig = rig_of()
    fault = next(f for f in ACTUATOR_FAULTS if f.name == "machine off")
    for memory in phases(rig, 0.3, 0.0502, 4):
        rig.recall(memory)
        apply_actuator(rig, fault)
        turn_for(rig, 0.1)
        text = next(t.text for t in rig.told if t.code == "mode safe")
        assert "machine takes up no power" in text or "beyond its limit" in text
