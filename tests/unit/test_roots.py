"""Roots from a good guess, kept within what makes sense."""

import math

import pytest

from hil.roots import newton, secant


def cubic(x):
    return x**3 - 8.0, 3.0 * x * x


def test_newton_finds_the_root_from_either_side():
    assert newton(cubic, 1.5) == pytest.approx(2.0, rel=1e-12)
    assert newton(cubic, 4.0) == pytest.approx(2.0, rel=1e-12)


def test_newton_stays_in_its_range_and_takes_no_longer_steps_than_asked():
    seen = []

    def f(x):
        seen.append(x)
        return cubic(x)

    assert newton(f, 0.1, low=0.05, high=1.0, steps=5) == 1.0
    seen.clear()
    newton(f, 5.0, most=0.25, steps=4)
    assert seen == [5.0, 4.75, 4.5, 4.25]


def test_newton_moves_on_where_there_is_no_slope():
    f = lambda x: (x - 1.0, 0.0 if x < 0.5 else 1.0)  # noqa: E731
    assert newton(f, 0.0, most=0.3) == 1.0


def test_newton_stops_at_a_step_that_is_small_enough():
    calls = []

    def f(x):
        calls.append(x)
        return cubic(x)

    newton(f, 2.1, close=0.2, steps=50)
    assert len(calls) == 1


def test_secant_finds_the_root_and_stands_still_on_a_flat_one():
    assert secant(lambda x: math.log(x) - 1.0, 2.0, steps=8, relative=1e-9) == pytest.approx(math.e)
    assert secant(lambda _: 1.0, 2.0, steps=5, relative=1e-9) == 2.04
