"""The wire as a whole: frames a tick, bus load, identifiers."""

import pytest

from bench.dev.messages_page import FRAME_BITS_MAX, frames_per_tick
from hil.wire.fields import LAYOUTS


def test_a_tick_has_at_most_six_frames_in_both_directions_together():
    counts = frames_per_tick()
    assert sum(counts.values()) == 6
    assert 6 * FRAME_BITS_MAX * 1000 < 0.82 * 1_000_000


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)
def test_identifiers_are_standard_ones(layout):
    assert 0 < layout.can_id < 0x800
    assert {layout.sender, layout.receiver} == {"plant", "controller"}


def test_the_plants_frames_win_the_arbitration():
    ids = {sender: [i for i, x in LAYOUTS.items() if x.sender == sender] for sender in
           ("plant", "controller")}  # fmt: skip
    assert max(ids["plant"]) < min(ids["controller"])
