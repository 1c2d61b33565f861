"""The loop on a bad bus: what is injected is noticed, and the engine survives or is made safe."""

import pytest

from bench.bus.faults import CASES, SAFE_TICKS, run_case, table
from bench.bus.rig import Rig
from bench.run import scenarios
from bench.run.resolve import resolve
from hil.wire.fields import layout_of
from hil.wire.messages import MachineCommand, PistonSample, PlantTick, Pulse

HEAD, SAMPLE = layout_of(PlantTick).can_id, layout_of(PistonSample).can_id
PULSE, MACHINE = layout_of(Pulse).can_id, layout_of(MachineCommand).can_id
BY_NAME = {case.name: case for case in CASES}


class Drop:
    """Loses the frames that a rule names."""

    def __init__(self, rule):
        self.rule = rule

    def apply(self, frames, tick):
        return [(f, 0) for f in frames if not self.rule(f, tick)]


def rig_of(rule, seconds=0.4):
    scenario = resolve(scenarios.read("steady", [("run.duration_s", seconds)]))
    rig = Rig(scenario, Drop(rule))
    for tick in range(round(seconds * 1000)):
        rig.turn(tick)
    return rig


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_a_second_of_each_fault_is_noticed_and_survived(case):
    outcome = run_case(case, 1.5)
    assert outcome.is_met, outcome


def test_nothing_is_noticed_on_a_good_bus():
    outcome = run_case(BY_NAME["none"], 1.0)
    assert sum(outcome.counts.values()) == outcome.counts["ok"]
    assert outcome.misfires == 0


@pytest.mark.parametrize("lost", range(0, 60, 3))
def test_a_single_lost_pulse_frame_costs_no_spark_and_no_fuel(lost):
    rig = rig_of(lambda f, _: f.can_id == PULSE and f.number == 20 + lost, 0.25)
    assert rig.tally.misfires == 0
    assert abs(abs(rig.plant.state.dead_centre.x_m) - 0.0155) < 0.1e-3


def test_no_injector_stays_open_when_the_controller_falls_silent():
    for silent in range(100, 125):
        rig = rig_of(lambda f, t, s=silent: f.sender == "controller" and t >= s, 0.2)
        assert rig.plant_is_safe
        assert all(line.open is None for line in rig.plant.state.pulses.table.lines)


@pytest.mark.parametrize("kind", [HEAD, SAMPLE])
def test_each_part_of_a_sample_that_stays_away_is_a_stale_sample(kind):
    rig = rig_of(lambda f, t: f.can_id == kind and t >= 150)
    assert rig.is_safe
    assert rig.without_sample[0] == 150
    assert rig.controller.reception.decoder.lost == 0


def test_ten_stale_ticks_are_allowed_and_then_it_is_safe():
    ticks = []

    def watched(frame, tick):
        return frame.sender == "plant" and tick >= 200

    scenario = resolve(scenarios.read("steady", [("run.duration_s", 0.3)]))
    rig = Rig(scenario, Drop(watched))
    for tick in range(300):
        rig.turn(tick)
        if rig.is_safe:
            ticks.append(tick)
    assert 200 < ticks[0] <= 200 + SAFE_TICKS


def test_a_machine_command_that_stays_away_leaves_the_last_one_in_force():
    rig = rig_of(lambda f, t: f.can_id == MACHINE and t >= 100, 0.3)
    assert rig.plant.state.machine.load_coefficient_n_s_m == pytest.approx(810.0)
    assert not rig.plant_is_safe


def test_the_table_has_a_row_for_each_case():
    text = table([run_case(CASES[0], 0.7)])
    assert "| none |" in text
    assert text.endswith("\n")
