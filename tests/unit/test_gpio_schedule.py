"""Pulses become edges in order, each once, and never a line left high."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.gpio.schedule import NEVER, Edge, EdgeSchedule, PlantClock, unwrapped_ns

MS = 1_000_000
CHANNELS = frozenset({0, 1, 2, 3})


def schedule(late_ns=0):
    return EdgeSchedule(CHANNELS, late_ns)


def test_a_pulse_opens_and_closes_at_its_times():
    s = schedule()
    s.order(0, 5 * MS, 7 * MS, now_ns=0)
    assert s.next_ns() == 5 * MS
    assert s.due(5 * MS - 1) == []
    assert s.due(5 * MS) == [Edge(5 * MS, 0, high=True)]
    assert s.next_ns() == 7 * MS
    assert s.due(7 * MS) == [Edge(7 * MS, 0, high=False)]
    assert s.next_ns() == NEVER


def test_a_repeated_pulse_changes_nothing_open_or_over():
    s = schedule()
    for now in (0, 4 * MS):
        s.order(2, 5 * MS, 6 * MS, now)
    s.due(5 * MS)
    s.order(2, 5 * MS, 6 * MS, 5 * MS + 1)
    assert s.due(6 * MS) == [Edge(6 * MS, 2, high=False)]
    s.order(2, 5 * MS, 6 * MS, 6 * MS + 1)
    assert s.next_ns() == NEVER


def test_a_newer_pulse_replaces_what_is_not_yet_due():
    s = schedule()
    s.order(1, 5 * MS, 7 * MS, 0)
    s.order(1, 6 * MS, 9 * MS, 1 * MS)
    assert s.due(8 * MS) == [Edge(6 * MS, 1, high=True)]
    s.order(1, 6 * MS, 8 * MS + 1, 8 * MS)  # an earlier closing of an open one
    assert s.due(8 * MS + 1) == [Edge(8 * MS + 1, 1, high=False)]


def test_an_opening_that_is_known_too_late_is_left_out_and_counted_once():
    s = schedule(late_ns=300_000)
    for now in (6 * MS, 6 * MS + 1):
        s.order(0, 5 * MS, 7 * MS, now)
    assert (s.late, s.next_ns()) == (1, NEVER)
    s.order(1, 5 * MS, 7 * MS, 5 * MS + 200_000)  # within the tolerance
    assert s.due(5 * MS + 200_000)[0].high


def test_channels_without_a_line_are_nobodys():
    s = schedule()
    s.order(6, 5 * MS, 7 * MS, 0)
    assert s.next_ns() == NEVER


def test_what_was_cleared_is_not_taken_up_again():
    s = schedule(late_ns=10 * MS)
    s.order(0, 5 * MS, 9 * MS, 0)
    s.due(5 * MS)
    s.clear(6 * MS)
    s.order(0, 5 * MS, 9 * MS, 6 * MS)
    assert s.next_ns() == NEVER


orders = st.lists(
    st.tuples(st.integers(0, 3), st.integers(0, 50), st.integers(1, 9), st.integers(0, 3)),
    max_size=40,
)


@given(orders)
def test_edges_alternate_and_end_low(pulses):
    """Whatever is ordered, a channel's edges alternate from high on and the last one is low."""
    s, levels, now = schedule(), dict.fromkeys(CHANNELS, False), 0
    for channel, ahead, length, pause in pulses:
        now += pause
        s.order(channel, now + ahead, now + ahead + length, now)
        for edge in s.due(now):
            assert levels[edge.channel] is not edge.high
            levels[edge.channel] = edge.high
    for edge in s.due(now + 1000):
        assert levels[edge.channel] is not edge.high
        levels[edge.channel] = edge.high
    assert not any(levels.values())


@given(st.integers(0, 2**50), st.integers(-400_000, 400_000))
def test_twenty_bits_of_microseconds_are_enough_within_half_a_second(now_us, ahead_us):
    open_us = now_us + ahead_us
    assert unwrapped_ns(open_us % (1 << 20), now_us * 1000) == open_us * 1000


def test_one_late_arrival_does_not_move_the_plants_clock():
    clock = PlantClock(MS, 0)
    for tick in range(50):
        clock.arrived(tick, 7_000 * MS + tick * MS + (900_000 if tick == 49 else 20_000))
    assert clock.plant_ns(7_000 * MS + 49 * MS + 20_000) - 49 * MS in range(-5_000, 1)
    assert clock.monotonic_ns(clock.plant_ns(123)) == 123


def test_a_plant_that_began_anew_is_followed():
    clock = PlantClock(MS, phase_ns=30_000)
    clock.arrived(100_000, 200_000 * MS)
    clock.arrived(0, 200_500 * MS)
    assert clock.plant_ns(200_500 * MS) == 30_000
