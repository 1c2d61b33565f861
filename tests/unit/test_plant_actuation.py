"""The pulse table: what is accepted, refused, replaced, and what flows."""

import pytest

from plant.rig.actuation import (
    CHANNELS_WITH_VALVES,
    CONTRADICTORY,
    INJECTOR_LEFT,
    LATE,
    OVERLAP,
    REASONS,
    SPARK_RIGHT,
    TOO_FAR_AHEAD,
    TOO_LONG,
    UNKNOWN_CHANNEL,
    Injector,
    Line,
    PulseOrder,
    PulseTable,
    advance,
    fuel_until,
    receive,
    scavenge,
    shut,
    unwrap_us,
)

INJECTOR = Injector((1e-3, 2e-3), 800_000.0)
US = 1000


def order(open_us, duration_us, channel=INJECTOR_LEFT):
    return PulseOrder(channel, open_us % 2**20, duration_us)


def enter(table, *orders, now_us=0):
    table, refused = receive(table, orders, now_us * US)
    return table, [reason for reason, _ in refused]


@pytest.mark.parametrize(
    ("now_us", "ahead_us"), [(0, 5), (2**20 - 3, 10), (123_456_789, 500_000), (5_000_000, -2000)]
)
def test_instants_are_unwrapped_around_now(now_us, ahead_us):
    assert unwrap_us((now_us + ahead_us) % 2**20, now_us) == now_us + ahead_us


def test_fuel_flows_from_the_dead_time_to_the_closing():
    table, refused = enter(PulseTable(), order(100, 2800))
    assert not refused
    for t_us, mass_kg in ((899, 0.0), (900, 0.0), (901, 1e-9), (1900, 1e-6), (2900, 2e-6)):
        now = advance(table, INJECTOR, t_us * US)
        assert fuel_until(now, INJECTOR, 0, t_us * US) == pytest.approx(mass_kg, abs=1e-18)
    done = advance(table, INJECTOR, 10_000 * US)
    assert fuel_until(done, INJECTOR, 0, 10_000 * US) == pytest.approx(2e-6)


def test_each_side_has_its_own_flow():
    table, _ = enter(PulseTable(), order(0, 1800, 0), order(0, 1800, 1))
    table = advance(table, INJECTOR, 2000 * US)
    assert table.fuel_kg == pytest.approx((1e-6, 2e-6))


def test_pulse_across_a_dead_centre_counts_on_both_sides_of_it():
    table, _ = enter(PulseTable(), order(0, 2800))
    table = advance(table, INJECTOR, 1300 * US)
    before = fuel_until(table, INJECTOR, 0, 1300 * US)
    table = scavenge(table, INJECTOR, 0, 1300 * US)
    assert fuel_until(table, INJECTOR, 0, 1300 * US) == 0.0
    table = advance(table, INJECTOR, 5000 * US)
    assert before == pytest.approx(0.5e-6)
    assert fuel_until(table, INJECTOR, 0, 5000 * US) == pytest.approx(1.5e-6)


def test_spark_strikes_at_the_opening_edge():
    table, _ = enter(PulseTable(), order(700, 1500, SPARK_RIGHT))
    assert advance(table, INJECTOR, 699 * US).spark_ns == (-1, -1)
    table = advance(table, INJECTOR, 700 * US)
    assert table.spark_ns == (-1, 700 * US)
    assert scavenge(table, INJECTOR, 1, 800 * US).spark_ns == (-1, -1)


def test_repeats_are_silent_before_during_and_just_after_the_pulse():
    pulse = order(2500, 1000)
    table, _ = enter(PulseTable(), pulse)
    for now_us in (0, 1000, 2000, 3000, 4000, 5000, 90_000):
        table = advance(table, INJECTOR, now_us * US)
        again, refused = enter(table, pulse, now_us=now_us)
        assert again == table
        assert not refused


def test_newer_order_replaces_what_has_not_opened():
    table, _ = enter(PulseTable(), order(2500, 1800))
    table, refused = enter(table, order(2600, 2300), now_us=1000)
    assert not refused
    table = advance(table, INJECTOR, 9000 * US)
    assert table.fuel_kg[0] == pytest.approx(1.5e-6)


def test_closing_of_an_open_pulse_moves_while_it_is_ahead():
    table, _ = enter(PulseTable(), order(0, 2800))
    table = advance(table, INJECTOR, 2000 * US)
    table, refused = enter(table, order(0, 2300), now_us=2000)
    assert not refused
    assert advance(table, INJECTOR, 9000 * US).fuel_kg[0] == pytest.approx(1.5e-6)


def test_next_pulse_may_be_ordered_while_one_is_open():
    table, _ = enter(PulseTable(), order(0, 1800))
    table = advance(table, INJECTOR, 1000 * US)
    table, refused = enter(table, order(0, 1800), order(3000, 1800), now_us=1000)
    assert not refused
    assert advance(table, INJECTOR, 9000 * US).fuel_kg[0] == pytest.approx(2e-6)


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
    table, _ = enter(PulseTable(), order(0, 2800))
    table = advance(table, INJECTOR, 1000 * US)
    assert enter(table, order(2000, 500), now_us=1000)[1] == [OVERLAP]


def test_closing_cannot_move_into_the_past():
    table, _ = enter(PulseTable(), order(0, 2800))
    table = advance(table, INJECTOR, 2000 * US)
    assert enter(table, order(0, 1500), now_us=2000)[1] == [LATE]


def test_duration_of_nought_takes_a_pulse_back():
    table, _ = enter(PulseTable(), order(2500, 1800))
    table, refused = enter(table, order(2500, 0), now_us=1000)
    assert not refused
    assert advance(table, INJECTOR, 9000 * US).fuel_kg[0] == 0.0


def test_duration_of_nought_closes_an_open_pulse_now():
    table, _ = enter(PulseTable(), order(0, 2800))
    table = advance(table, INJECTOR, 2000 * US)
    table, refused = enter(table, order(0, 0), now_us=2000)
    assert not refused
    assert advance(table, INJECTOR, 9000 * US).fuel_kg[0] == pytest.approx(1.2e-6)


def test_shutting_closes_what_is_open_and_drops_what_is_to_come():
    table, _ = enter(PulseTable(), order(0, 2800), order(4000, 100, SPARK_RIGHT))
    table = shut(advance(table, INJECTOR, 2000 * US), INJECTOR, 2000 * US)
    assert all(line.open is None and line.pending is None for line in table.lines)
    table = advance(table, INJECTOR, 9000 * US)
    assert (table.fuel_kg[0], table.spark_ns) == (pytest.approx(1.2e-6), (-1, -1))


def test_a_table_with_valve_lines_takes_their_long_pulses():
    table = PulseTable(lines=(Line(),) * CHANNELS_WITH_VALVES)
    table, refused = enter(table, order(100, 60_000, 7), order(100, 30_000, INJECTOR_LEFT))
    assert refused == [TOO_LONG]
    assert advance(table, INJECTOR, 200 * US).lines[7].open is not None
    assert advance(table, INJECTOR, 70_000 * US).lines[7].open is None


def test_a_valve_edge_is_neither_spark_nor_fuel():
    table = PulseTable(lines=(Line(),) * CHANNELS_WITH_VALVES)
    table, _ = enter(table, *(order(100, 1000, channel) for channel in (4, 5, 6, 7)))
    table = advance(table, INJECTOR, 2000 * US)
    assert table.spark_ns == (-1, -1)
    assert table.fuel_kg == (0.0, 0.0)
