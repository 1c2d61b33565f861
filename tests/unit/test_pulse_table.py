"""The pulse table: what is accepted, known, replaced, withdrawn, refused, and its edges."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.values import NEVER
from hil.wire import pulses
from hil.wire.messages import (
    CHANNELS,
    INJECTOR_LEFT,
    OPERATING_MODES,
    PULSE_CLOCK_US,
    SPARK_RIGHT,
)
from hil.wire.pulses import (
    BACK_US,
    CONTRADICTORY,
    FURTHEST_US,
    INJECTOR,
    KINDS,
    LATE,
    LONGEST_US,
    OVERLAP,
    REASONS,
    REPEAT_NS,
    SPARK,
    TOO_FAR_AHEAD,
    TOO_LONG,
    UNKNOWN_CHANNEL,
    VALVE,
    PulseOrder,
    PulseTable,
    advance,
    follow,
    lines_for,
    receive,
    unwrap_ns,
    wrap_us,
)

US = 1000
FOR_EVER_NS = 10**12


def order(open_us, duration_us, channel=INJECTOR_LEFT):
    return PulseOrder(channel, open_us % 2**20, duration_us)


def enter(table, *orders, now_us=0):
    table, refused = receive(table, orders, now_us * US)
    return table, [reason for reason, _ in refused]


def edges(table, to_us=FOR_EVER_NS // US):
    """(instant [us], channel, level) of what is due."""
    return [(e.t_ns / US, e.channel, e.high) for e in advance(table, to_us * US)[1]]


def opened(*orders, at_us):
    """A table with pulses on their way, at a later instant."""
    return advance(enter(PulseTable(), *orders)[0], at_us * US)[0]


def test_each_channel_has_its_kind():
    kinds = dict(zip(CHANNELS.values(), KINDS, strict=True))
    assert {name for name, kind in kinds.items() if kind == VALVE} == {
        "intake_left", "exhaust_left", "intake_right", "exhaust_right",
    }  # fmt: skip
    assert (kinds["injector_right"], kinds["spark_left"]) == (INJECTOR, SPARK)


def test_lines_may_be_high_in_two_modes_only():
    firing = {name for number, name in OPERATING_MODES.items() if pulses.may_fire(number)}
    assert firing == {"motoring", "generating"}


@pytest.mark.parametrize(
    ("now_us", "ahead_us"), [(0, 5), (2**20 - 3, 10), (123_456_789, 500_000), (5_000_000, -2000)]
)
def test_instants_are_unwrapped_around_now(now_us, ahead_us):
    assert unwrap_ns((now_us + ahead_us) % 2**20, now_us * US) == (now_us + ahead_us) * US


@given(st.integers(0, 2**50), st.integers(-BACK_US, PULSE_CLOCK_US - BACK_US - 1))
def test_what_was_wrapped_is_found_again_within_a_turn_of_the_clock(now_us, ahead_us):
    t_ns = (now_us + ahead_us) * US
    assert unwrap_ns(wrap_us(t_ns), now_us * US + 999) == t_ns


def test_whatever_is_sent_and_may_still_come_in_lies_inside_the_turn():
    """The longest pulse until nobody repeats it, and what is refused as too far ahead."""
    assert max(LONGEST_US.values()) + REPEAT_NS // US < BACK_US
    assert FURTHEST_US < PULSE_CLOCK_US - BACK_US


def test_a_pulse_is_two_edges():
    table, refused = enter(PulseTable(), order(100, 2800))
    assert not refused
    assert table.next_edge_ns == 100 * US
    assert edges(table, 99) == []
    assert edges(table) == [(100, 0, True), (2900, 0, False)]
    assert advance(table, FOR_EVER_NS)[0].next_edge_ns == NEVER


def test_repeats_are_silent_before_during_and_just_after_the_pulse():
    pulse = order(2500, 1000)
    table, _ = enter(PulseTable(), pulse)
    for now_us in (0, 1000, 2000, 3000, 4000, 5000, 90_000):
        table, _ = advance(table, now_us * US)
        again, refused = enter(table, pulse, now_us=now_us)
        assert again == table
        assert not refused


def test_newer_order_replaces_what_has_not_opened():
    table, _ = enter(PulseTable(), order(2500, 1800))
    table, refused = enter(table, order(2600, 2300), now_us=1000)
    assert not refused
    assert edges(table) == [(2600, 0, True), (4900, 0, False)]


def test_closing_of_an_open_pulse_moves_while_it_is_ahead():
    table, refused = enter(opened(order(0, 2800), at_us=2000), order(0, 2300), now_us=2000)
    assert not refused
    assert edges(table) == [(2300, 0, False)]


def test_next_pulse_may_be_ordered_while_one_is_open():
    table = opened(order(0, 1800), at_us=1000)
    table, refused = enter(table, order(0, 1800), order(3000, 1800), now_us=1000)
    assert not refused
    assert edges(table) == [(1800, 0, False), (3000, 0, True), (4800, 0, False)]


@pytest.mark.parametrize(
    ("orders", "now_us", "reason"),
    [
        ([order(100, 500)], 200, LATE),
        ([order(5, 500, 4)], 0, UNKNOWN_CHANNEL),
        ([order(5, 500, -1)], 0, UNKNOWN_CHANNEL),
        ([order(5, 20_001)], 0, TOO_LONG),
        ([order(2**19 + 1, 500)], 0, TOO_FAR_AHEAD),
        ([order(100, 500), order(200, 500)], 0, CONTRADICTORY),
    ],
)
def test_bad_orders_are_refused_and_counted_once(orders, now_us, reason):
    table, refused = enter(PulseTable(), *orders, now_us=now_us)
    assert refused == [reason]
    assert table.refusals[REASONS.index(reason)] == 1
    if reason != UNKNOWN_CHANNEL:
        assert enter(table, orders[-1], now_us=now_us)[1] == []


def test_overlap_with_an_open_pulse_is_refused():
    table = opened(order(0, 2800), at_us=1000)
    assert enter(table, order(2000, 500), now_us=1000)[1] == [OVERLAP]


def test_a_closing_does_not_move_into_the_pulse_to_come():
    table, _ = enter(opened(order(0, 1800), at_us=1000), order(3000, 500), now_us=1000)
    table, refused = enter(table, order(0, 3001), now_us=1000)
    assert refused == [OVERLAP]
    assert edges(table) == [(1800, 0, False), (3000, 0, True), (3500, 0, False)]


def test_closing_cannot_move_into_the_past():
    table = opened(order(0, 2800), at_us=2000)
    assert enter(table, order(0, 1500), now_us=2000)[1] == [LATE]


def test_duration_of_nought_takes_a_pulse_back():
    table, _ = enter(PulseTable(), order(2500, 1800))
    table, refused = enter(table, order(2500, 0), now_us=1000)
    assert not refused
    assert edges(table) == []


def test_duration_of_nought_closes_an_open_pulse_now():
    table, refused = enter(opened(order(0, 2800), at_us=2000), order(0, 0), now_us=2000)
    assert not refused
    assert edges(table) == [(2000, 0, False)]


def test_a_mode_that_does_not_fire_closes_what_is_open_and_drops_what_is_to_come():
    table = opened(order(0, 2800), order(4000, 100, SPARK_RIGHT), at_us=2000)
    table, refused = follow(table, False, (order(5000, 100),), 2000 * US)
    assert not refused
    assert edges(table) == [(2000, 0, False)]
    after = advance(table, 2000 * US)[0]
    assert follow(after, False, (), 3000 * US)[0] is after


def test_a_table_with_valve_lines_takes_their_long_pulses():
    table, refused = enter(lines_for(8), order(100, 60_000, 7), order(100, 30_000, INJECTOR_LEFT))
    assert refused == [TOO_LONG]
    assert edges(table) == [(100, 7, True), (60_100, 7, False)]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 1), st.integers(-3, 12), st.integers(0, 6), st.integers(0, 4),
            st.booleans(),
        ),
        max_size=40,
    )
)  # fmt: skip
def test_edges_of_a_line_alternate_go_forward_and_end_low(script):
    table, now_us, seen = PulseTable(), 0, []
    for channel, ahead_us, duration_us, pause_us, fires in script:
        now_us += pause_us
        table, due = advance(table, now_us * US)
        seen += due
        table, _ = follow(
            table, fires, (order(now_us + ahead_us, duration_us, channel),), now_us * US
        )
    seen += advance(table, FOR_EVER_NS)[1]
    for channel in (0, 1):
        own = [edge for edge in seen if edge.channel == channel]
        assert [edge.high for edge in own] == [True, False] * (len(own) // 2)
        assert [edge.t_ns for edge in own] == sorted(edge.t_ns for edge in own)
