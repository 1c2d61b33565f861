"""The mean power of a stroke from readings every other tick."""

import math

import pytest

from controller.observe.power import UNMETERED, ended, read


@pytest.mark.parametrize("stroke_ms", [17.3, 25.07, 30.9])
@pytest.mark.parametrize("every_ms", [1, 2])
def test_readings_of_a_sine_give_its_mean_power(stroke_ms, every_ms):
    """P = c v^2 of v = V sin(pi t / T) has the mean c V^2 / 2."""
    metering, dead_centre, means = UNMETERED, 1, []
    for ms in range(0, 400, every_ms):
        while dead_centre * stroke_ms <= ms:
            metering = ended(metering, round(dead_centre * stroke_ms * 1e6))
            means.append(metering.mean_w)
            dead_centre += 1
        power_w = 1000.0 * math.sin(math.pi * ms / stroke_ms) ** 2
        metering = read(metering, ms * 1_000_000, power_w)
    assert means[0] is None
    assert means[1:] == pytest.approx([500.0] * (len(means) - 1), rel=2e-3)


def test_a_tick_without_a_reading_leaves_the_meter_alone():
    assert read(UNMETERED, 1_000_000, math.nan) is UNMETERED
