"""The wire as a whole: frames a tick, bus load, and numbers that other tables repeat."""

import pytest

from bench.dev.generate import FRAME_BITS_MAX, frames_per_tick
from controller.actuator import MAX_PULSES
from controller.mode.start_restart import Mode
from hil.wire import messages
from hil.wire.fields import LAYOUTS
from plant.engines import machine


def test_a_tick_has_at_most_six_frames_in_both_directions_together():
    counts = frames_per_tick()
    assert sum(counts.values()) == 6
    assert 6 * FRAME_BITS_MAX * 1000 < 0.82 * 1_000_000


def test_the_controller_sends_no_more_pulses_than_the_bus_load_counts():
    assert LAYOUTS[0x202].per_tick == MAX_PULSES


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)
def test_identifiers_are_standard_ones(layout):
    assert 0 < layout.can_id < 0x800
    assert {layout.sender, layout.receiver} == {"plant", "controller"}


def test_the_plants_frames_win_the_arbitration():
    ids = {sender: [i for i, x in LAYOUTS.items() if x.sender == sender] for sender in
           ("plant", "controller")}  # fmt: skip
    assert max(ids["plant"]) < min(ids["controller"])


def test_modes_and_channels_have_one_numbering():
    assert {int(mode): mode.name.lower() for mode in Mode} == messages.OPERATING_MODES
    assert (messages.OFF, messages.MOTOR, messages.GENERATOR) == (
        machine.OFF,
        machine.MOTOR,
        machine.GENERATOR,
    )
    assert messages.CHANNELS[messages.SPARK_RIGHT] == "spark_right"
