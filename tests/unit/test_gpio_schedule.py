"""Answers act at their tick, silence shuts, and the plant's clock is learnt from arrivals."""

import pytest

from drivers.gpio.schedule import EdgeSchedule, PlantClock
from hil.values import NEVER
from hil.wire.messages import Pulse

MS = 1_000_000
GENERATING, STOPPING = 2, 3


def schedule(*answers):
    """A schedule that has heard (tick [ms], mode, pulses)."""
    made = EdgeSchedule(silence_ns=10 * MS)
    for acts_ms, mode, *sent in answers:
        made.answer(acts_ms * MS, mode, sent)
    return made


def shown(edges):
    return [(edge.t_ns / MS, edge.channel, edge.high) for edge in edges]


def test_an_answer_acts_at_its_tick_and_not_before():
    s = schedule((2, GENERATING, Pulse(0, 2_000, 500)))
    assert s.next_ns() == 2 * MS
    assert s.due(2 * MS - 1) == []
    assert shown(s.due(2 * MS)) == [(2, 0, True)]
    assert s.next_ns() == 2_500_000
    assert shown(s.due(9 * MS)) == [(2.5, 0, False)]
    assert s.next_ns() == NEVER


def test_the_next_edge_is_known_of_an_answer_that_does_not_act_yet():
    s = schedule((1, GENERATING, Pulse(0, 1_500, 8_000)))
    s.due(2 * MS)
    s.answer(4 * MS, STOPPING, [])
    assert s.next_ns() == 4 * MS
    assert shown(s.due(5 * MS)) == [(4, 0, False)]


def test_a_schedule_that_is_looked_at_late_gives_the_same_edges():
    answers = [(k, GENERATING, Pulse(2, 3_100, 4_000)) for k in range(1, 5)] + [(5, STOPPING)]
    early, late = schedule(*answers), schedule(*answers)
    seen = [edge for now_us in range(0, 20_000, 100) for edge in early.due(now_us * 1000)]
    assert shown(seen) == shown(late.due(20 * MS)) == [(3.1, 2, True), (5, 2, False)]


def test_silence_shuts_before_what_comes_after_it():
    s = schedule((1, GENERATING, Pulse(5, 1_500, 60_000)), (30, GENERATING))
    assert shown(s.due(40 * MS)) == [(1.5, 5, True), (11, 5, False)]


@pytest.mark.parametrize("mode", [None, GENERATING])
def test_an_answer_without_a_head_says_nothing_by_itself(mode):
    s = schedule((1, None, Pulse(0, 1_500, 500)), (1, mode, Pulse(2, 1_600, 500)))
    edges = (
        [] if mode is None else [(1.5, 0, True), (1.6, 2, True), (2.0, 0, False), (2.1, 2, False)]
    )
    assert shown(s.due(5 * MS)) == edges


def test_one_late_arrival_does_not_move_the_plants_clock():
    clock = PlantClock(MS, 0)
    for tick in range(50):
        clock.arrived(tick, 7_000 * MS + tick * MS + (900_000 if tick == 49 else 20_000))
    assert clock.plant_ns(7_000 * MS + 49 * MS + 20_000) - 49 * MS in range(-5_000, 1)
    assert clock.monotonic_ns(clock.plant_ns(123)) == 123


def test_a_plant_that_began_anew_is_followed():
    clock = PlantClock(MS, phase_ns=30_000)
    assert clock.arrived(100_000, 200_000 * MS)
    assert not clock.arrived(100_001, 200_001 * MS)
    assert clock.arrived(0, 200_500 * MS)
    assert clock.plant_ns(200_500 * MS) == 30_000


def test_the_next_tick_is_that_which_begins_at_an_instant_or_after_it():
    clock = PlantClock(MS, 0)
    clock.arrived(0, 500 * MS)
    assert [clock.tick_after(500 * MS + t_ns) for t_ns in (0, 1, MS, MS + 1)] == [0, 1, 1, 2]
