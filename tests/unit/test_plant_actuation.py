"""From the edges of the lines to fuel that has flowed and sparks that have struck."""

import pytest

from hil.wire.messages import INJECTOR_LEFT, SPARK_RIGHT
from hil.wire.pulses import PulseOrder, follow, lines_for
from plant.rig.actuation import Actuation, Injector, advance, fuel_until, scavenge, with_table

INJECTOR = Injector((1e-3, 2e-3), 800_000.0)
US = 1000


def order(open_us, duration_us, channel=INJECTOR_LEFT):
    return PulseOrder(channel, open_us, duration_us)


def ordered(*orders, before=None, fires=True, now_us=0):
    before = before or Actuation()
    table, refused = follow(before.table, fires, orders, now_us * US)
    assert not refused
    return with_table(before, table)


def test_fuel_flows_from_the_dead_time_to_the_closing():
    lines = ordered(order(100, 2800))
    for t_us, mass_kg in ((899, 0.0), (900, 0.0), (901, 1e-9), (1900, 1e-6), (2900, 2e-6)):
        now = advance(lines, INJECTOR, t_us * US)
        assert fuel_until(now, INJECTOR, 0, t_us * US) == pytest.approx(mass_kg, abs=1e-18)
    done = advance(lines, INJECTOR, 10_000 * US)
    assert fuel_until(done, INJECTOR, 0, 10_000 * US) == pytest.approx(2e-6)


def test_each_side_has_its_own_flow():
    lines = ordered(order(0, 1800, 0), order(0, 1800, 1))
    assert advance(lines, INJECTOR, 2000 * US).fuel_kg == pytest.approx((1e-6, 2e-6))


def test_pulse_across_a_dead_centre_counts_on_both_sides_of_it():
    lines = advance(ordered(order(0, 2800)), INJECTOR, 1300 * US)
    before = fuel_until(lines, INJECTOR, 0, 1300 * US)
    lines = scavenge(lines, INJECTOR, 0, 1300 * US)
    assert fuel_until(lines, INJECTOR, 0, 1300 * US) == 0.0
    lines = advance(lines, INJECTOR, 5000 * US)
    assert before == pytest.approx(0.5e-6)
    assert fuel_until(lines, INJECTOR, 0, 5000 * US) == pytest.approx(1.5e-6)


def test_spark_strikes_at_the_opening_edge():
    lines = ordered(order(700, 1500, SPARK_RIGHT))
    assert advance(lines, INJECTOR, 699 * US).spark_ns == (-1, -1)
    lines = advance(lines, INJECTOR, 700 * US)
    assert lines.spark_ns == (-1, 700 * US)
    assert scavenge(lines, INJECTOR, 1, 800 * US).spark_ns == (-1, -1)


def test_an_injector_that_is_shut_has_fed_until_then_and_no_spark_strikes():
    lines = advance(
        ordered(order(0, 2800), order(4000, 100, SPARK_RIGHT)), INJECTOR, 2000 * US
    )  # fmt: skip
    lines = advance(ordered(before=lines, fires=False, now_us=2000), INJECTOR, 9000 * US)
    assert (lines.fuel_kg[0], lines.spark_ns) == (pytest.approx(1.2e-6), (-1, -1))


def test_a_valve_edge_is_neither_spark_nor_fuel():
    orders = [order(100, 1000, channel) for channel in (4, 5, 6, 7)]
    lines = advance(ordered(*orders, before=Actuation(lines_for(8))), INJECTOR, 2000 * US)
    assert lines.spark_ns == (-1, -1)
    assert lines.fuel_kg == (0.0, 0.0)
