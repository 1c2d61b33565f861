"""Losses at every phase of a stroke: both sides are in their safe state in time, and stay there."""

import pytest

from bench.run import scenarios
from bench.run.resolve import resolve
from bench.trust.rig import Rig
from controller.mode.start_restart import Mode

SAFE_MS = 20
PHASES = 25


def rig_of(scenario="steady", rate_hz=1000, **changes):
    given = [("link.kind", "memory"), ("loop.rate_hz", rate_hz), *changes.items()]
    return Rig(resolve(scenarios.read(scenario, given)))


def phases(rig, begin_s, span_s=0.0502, count=PHASES):
    """Memories of the rig, evenly over a cycle."""
    rate = rig.scenario.loop.rate_hz
    found = []
    for number in range(count):
        while rig.tick < round((begin_s + span_s * number / count) * rate):
            rig.turn()
        found.append(rig.remember())
    return found


def turn_for(rig, seconds):
    for _ in range(round(seconds * rig.scenario.loop.rate_hz)):
        rig.turn()


def samples_lost(rig, lost):
    rig.plant_link.silent = lost


def answers_lost(rig, lost):
    rig.controller_link.silent = lost


def both_lost(rig, lost):
    rig.plant_link.silent = rig.controller_link.silent = lost


def controller_frozen(rig, lost):
    rig.controller_frozen = lost


def both_frozen(rig, lost):
    rig.plant_frozen = rig.controller_frozen = lost


LOSSES = (samples_lost, answers_lost, both_lost)
MODES = {
    Mode.GENERATING: ("steady", 0.3, 0.0502), Mode.MOTORING: ("start", 0.13, 0.1),
    Mode.STOPPING: ("steady", 0.3, 0.02),
}  # fmt: skip


@pytest.mark.parametrize("rate_hz", [500, 1000, 5000])
@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name.lower())
@pytest.mark.parametrize("loss", LOSSES)
def test_every_loss_ends_in_the_safe_state_in_time_and_without_a_contact(rate_hz, mode, loss):
    scenario, begin_s, span_s = MODES[mode]
    rig = rig_of(scenario, rate_hz)
    if mode is Mode.STOPPING:
        turn_for(rig, 0.28)
        rig.commands.submit("operator", {"kind": "stop"})
    for memory in phases(rig, begin_s, span_s, 8 if rate_hz > 1000 else PHASES):
        rig.recall(memory)
        assert rig.controller.state.mode is mode
        loss(rig, True)
        turn_for(rig, SAFE_MS * 1e-3)
        assert rig.is_controller_safe
        assert (loss is samples_lost) or rig.plant.state.latch
        turn_for(rig, 0.15)
        assert rig.contacts == 0


@pytest.mark.parametrize("frozen_s", [0.3, 1.0])
def test_a_controller_that_was_frozen_moves_nothing_until_it_is_started(frozen_s):
    rig = rig_of()
    for memory in phases(rig, 0.3, count=6):
        rig.recall(memory)
        controller_frozen(rig, True)
        turn_for(rig, frozen_s)
        controller_frozen(rig, False)
        turn_for(rig, 0.4)
        codes = [told.code for told in rig.told]
        assert rig.is_controller_safe
        assert rig.plant.state.latch
        assert not rig.plant.state.moving
        assert not {"safe-state-left", "in-motion"} & set(codes)
        assert rig.contacts == 0


def test_a_start_leads_out_of_the_safe_state_of_both():
    rig = rig_of()
    turn_for(rig, 0.3)
    controller_frozen(rig, True)
    turn_for(rig, 0.3)
    controller_frozen(rig, False)
    turn_for(rig, 0.2)
    rig.commands.submit("operator", {"kind": "start"})
    turn_for(rig, 1.5)
    assert rig.controller.state.mode is Mode.GENERATING
    assert not rig.plant.state.latch
    assert rig.contacts == 0


def test_the_latch_of_the_plant_does_not_stop_a_controller_that_has_just_been_started():
    """Its samples say "safe state" until the first answer in motoring has acted."""
    rig = rig_of("start")
    turn_for(rig, 0.02)
    answers_lost(rig, True)
    turn_for(rig, 0.03)
    answers_lost(rig, False)
    assert rig.plant.state.latch
    turn_for(rig, 1.0)
    assert rig.controller.state.mode is Mode.GENERATING


def test_with_rearming_the_plant_goes_on_when_its_controller_returns():
    rig = rig_of(**{"safety.rearm": True})
    turn_for(rig, 0.3)
    controller_frozen(rig, True)
    turn_for(rig, 0.3)
    controller_frozen(rig, False)
    turn_for(rig, 0.1)
    assert not rig.plant.state.latch
    assert "safety.rearm" in next(t.text for t in rig.told if t.code == "safe-state-left")


STALLS = {
    "answers lost": answers_lost, "samples lost": samples_lost,
    "controller frozen": controller_frozen, "both frozen": both_frozen,
}  # fmt: skip


@pytest.mark.parametrize("stall", STALLS.values(), ids=STALLS)
@pytest.mark.parametrize("model", ["harmonic", "rectangular", "nonlinear", "closed-form"])
@pytest.mark.parametrize("rate_hz", [1000, 5000])
def test_a_stall_of_9_ms_costs_no_stroke_at_any_phase(model, rate_hz, stall):
    """The next charge is ordered ahead, and what nobody saw is not judged."""
    rig = rig_of(rate_hz=rate_hz, **{"plant.model": model})
    reach_m = rig.scenario.controller.tdc_ref_m
    for memory in phases(rig, 0.3, count=24 if rate_hz == 1000 else 6):
        rig.recall(memory)
        stall(rig, True)
        turn_for(rig, 0.009)
        stall(rig, False)
        number = rig.plant.state.dead_centre.number
        while rig.plant.state.dead_centre.number < number + 6:
            rig.turn()
            centre = rig.plant.state.dead_centre
            assert abs(abs(centre.x_m) - reach_m) < 0.3e-3
        assert rig.controller.state.mode is Mode.GENERATING
        assert not {"misfire", "safe-state", "mode motoring"} & {told.code for told in rig.told}
