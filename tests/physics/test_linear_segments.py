"""The exact solution of the linear engine against its own equation of motion."""

import math

import pytest

from plant.engines.fast.linear import (
    CRITICAL,
    OVERDAMPED,
    UNDERDAMPED,
    acceleration,
    advance,
    evaluate,
    half_cosine,
    segment,
)

M, K = 7.0, 30_000.0
CRITICAL_C = 2.0 * math.sqrt(K * M)
OMEGA = math.sqrt(K / M)
DAMPINGS = (0.0, 1e-6, 1e-3, 1.0, 810.0, CRITICAL_C * 0.999999, CRITICAL_C, 1500.0, 9000.0)


def integrate(c, force, sine, *, x, v, tau, end, steps=4000):
    """Fourth-order Runge-Kutta: knows only the equation of motion."""

    def slope(t, x, v):
        return v, (force + sine * math.sin(OMEGA * t) - c * v - K * x) / M

    h = (end - tau) / steps
    for _ in range(steps):
        a, b = slope(tau, x, v)
        a2, b2 = slope(tau + h / 2, x + h / 2 * a, v + h / 2 * b)
        a3, b3 = slope(tau + h / 2, x + h / 2 * a2, v + h / 2 * b2)
        a4, b4 = slope(tau + h, x + h * a3, v + h * b3)
        x += h / 6 * (a + 2 * a2 + 2 * a3 + a4)
        v += h / 6 * (b + 2 * b2 + 2 * b3 + b4)
        tau += h
    return x, v


@pytest.mark.parametrize("c", DAMPINGS)
@pytest.mark.parametrize("sine", [0.0, 1500.0])
def test_solution_satisfies_the_equation_of_motion(c, sine):
    path = segment(M, c, K, force_n=-300.0, sine_n=sine, x=-0.011, v=0.4, tau=0.003)
    expected = integrate(c, -300.0, sine, x=-0.011, v=0.4, tau=0.003, end=0.030)
    assert evaluate(path, 0.030) == pytest.approx(expected, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("c", DAMPINGS)
def test_solution_starts_where_it_was_told(c):
    path = segment(M, c, K, force_n=50.0, sine_n=900.0, x=0.004, v=-1.3, tau=0.011)
    assert evaluate(path, 0.011) == pytest.approx((0.004, -1.3), abs=1e-9)


@pytest.mark.parametrize("c", DAMPINGS)
def test_acceleration_is_the_slope_of_velocity(c):
    path = segment(M, c, K, force_n=50.0, sine_n=900.0, x=0.004, v=-1.3, tau=0.0)
    h, t = 1e-6, 0.008
    x, v = evaluate(path, t)
    slope = (evaluate(path, t + h)[1] - evaluate(path, t - h)[1]) / (2 * h)
    assert acceleration(path, t, x, v) == pytest.approx(slope, rel=1e-5, abs=1e-3)


@pytest.mark.parametrize(
    ("c", "regime"), [(810.0, UNDERDAMPED), (CRITICAL_C, CRITICAL), (1500.0, OVERDAMPED)]
)
def test_each_damping_has_its_regime(c, regime):
    path = segment(M, c, K, force_n=0.0, sine_n=0.0, x=0.01, v=0.0, tau=0.0)
    assert path.regime == regime


def test_overdamped_creep_overflows_nothing():
    path = segment(M, 10_000.0, K, force_n=0.0, sine_n=0.0, x=0.015, v=0.0, tau=0.0)
    assert evaluate(path, 1000.0) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_settled_stroke_is_equation_5_60():
    f0, c = 1571.0, 810.0
    amplitude = f0 / (c * OMEGA)
    path = segment(M, c, K, force_n=0.0, sine_n=f0, x=-amplitude, v=0.0, tau=0.0)
    for t in (0.0, 0.007, 0.02):
        assert evaluate(path, t)[0] == pytest.approx(-amplitude * math.cos(OMEGA * t), abs=1e-15)


def test_half_cosine_joins_two_dead_centres():
    path = half_cosine(OMEGA, -0.010, 0.016)
    assert evaluate(path, 0.0) == pytest.approx((-0.010, 0.0))
    assert evaluate(path, math.pi / OMEGA) == pytest.approx((0.016, 0.0), abs=1e-12)


def test_free_swing_reaches_its_dead_centre_to_a_picosecond():
    path = segment(M, 0.0, K, force_n=0.0, sine_n=0.0, x=-0.010, v=0.0, tau=0.0)
    x, v, used, stop = advance(path, 0.0, 0.060, 1, 0.020)
    assert used == pytest.approx(math.pi / OMEGA, abs=1e-12)
    assert (x, v, stop) == (pytest.approx(0.010, abs=1e-15), 0.0, 1)


def test_contact_is_located_where_the_swing_crosses_it():
    path = segment(M, 0.0, K, force_n=0.0, sine_n=0.0, x=-0.020, v=0.0, tau=0.0)
    x, v, used, stop = advance(path, 0.0, 0.040, 1, 0.010)
    assert used == pytest.approx(2.0 / 3.0 * math.pi / OMEGA, abs=1e-12)
    assert v == pytest.approx(0.020 * OMEGA * math.sin(2.0 / 3.0 * math.pi))
    assert (x, stop) == (0.010, 2)
