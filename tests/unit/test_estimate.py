"""Dead centres and mid-strokes between the samples, against motions that are known exactly."""

import math
from itertools import pairwise

import pytest

from controller.observe.estimate import (
    NOTHING,
    Motion,
    crossing_between,
    dead_centre_between,
    observe,
    seconds_to_dead_centre,
    smooth_dead_centre_between,
    update,
)
from hil.wire.messages import PistonSample

MS = 1_000_000
OMEGA = 2.0 * math.pi * 19.94
X = 0.0155


def swing(t, phase=0.0):
    """x = -X cos(omega t + phase): dead centres where the argument is a multiple of pi."""
    return -X * math.cos(OMEGA * t + phase), X * OMEGA * math.sin(OMEGA * t + phase)


def kicked(t, dc_s=0.0102, before=-240.0, after=-420.0, x_dc=0.0155):
    """Constant acceleration on both sides of a dead centre at which combustion changes it."""
    s = t - dc_s
    a = before if s < 0.0 else after
    return x_dc + 0.5 * a * s * s, a * s


def follow(motion_of, ticks, period_ns=MS):
    """Feed these ticks; returns the motion and (tick, what was passed) where something was."""
    motion, seen = Motion(), []
    for tick in ticks:
        t_ns = tick * period_ns
        motion, passed = update(motion, t_ns, *motion_of(t_ns * 1e-9))
        if passed is not NOTHING:
            seen.append((tick, passed, motion))
    return motion, seen


@pytest.mark.parametrize("phase", [0.01 * k for k in range(0, 13, 2)])
@pytest.mark.parametrize("rate_hz", [500, 1000, 5000])
def test_dead_centres_of_a_sine_are_found_between_the_samples(rate_hz, phase):
    """Error j s^3 / 12 with j = X omega^3 and s at most half a tick off the middle."""
    period_ns = 10**9 // rate_hz
    _, seen = follow(lambda t: swing(t, phase), range(rate_hz // 5), period_ns)
    found = [m for _, passed, m in seen if passed.dead_centre]
    bound = max(X * OMEGA**3 * (period_ns * 1e-9) ** 3 / 12, 2e-9)
    assert len(found) >= 7
    for motion in found:
        nearest = round((OMEGA * motion.dc_t_ns * 1e-9 + phase) / math.pi)
        exact_s = (nearest * math.pi - phase) / OMEGA
        assert motion.tdc_m == pytest.approx(X, abs=bound)
        assert motion.dc_t_ns * 1e-9 == pytest.approx(exact_s, abs=1e-2 * period_ns * 1e-9)
        assert motion.side == nearest % 2
    assert [m.side for m in found] == [(found[0].side + k) % 2 for k in range(len(found))]
    assert [m.stroke for m in found] == list(range(1, len(found) + 1))


@pytest.mark.parametrize("dc_s", [0.01 + 1e-4 * k for k in range(1, 10)])
def test_jump_of_the_acceleration_at_the_dead_centre_costs_nothing(dc_s):
    """The interpolation assumes nothing else, so it is exact for two parabolas."""
    before, after = kicked(0.010, dc_s), kicked(0.011, dc_s)
    t_ns, x_m = dead_centre_between(10 * MS, *before, 11 * MS, *after)
    assert x_m == pytest.approx(0.0155, abs=1e-12)
    assert t_ns == pytest.approx(dc_s * 1e9, abs=2)


@pytest.mark.parametrize("missing", [1, 2, 4])
@pytest.mark.parametrize("dc_s", [0.0101, 0.0105, 0.0119])
def test_a_lost_sample_widens_the_gap_and_nothing_else(dc_s, missing):
    first, second = 10 - missing // 2, 11 + (missing + 1) // 2
    x, v = kicked(first * 1e-3, dc_s)
    x2, v2 = kicked(second * 1e-3, dc_s)
    t_ns, x_m = dead_centre_between(first * MS, x, v, second * MS, x2, v2)
    assert x_m == pytest.approx(0.0155, abs=1e-12)
    assert t_ns == pytest.approx(dc_s * 1e9, abs=2)


@pytest.mark.parametrize("lost", [{25}, {24, 25, 26}, {12, 13}, {25, 50}])
def test_strokes_are_counted_and_measured_through_lost_samples(lost):
    _, whole = follow(swing, range(120))
    _, torn = follow(swing, [tick for tick in range(120) if tick not in lost])
    assert [(p, m.side, m.stroke) for _, p, m in torn] == [
        (p, m.side, m.stroke) for _, p, m in whole
    ]
    for (_, _, a), (_, _, b) in zip(whole, torn, strict=True):
        assert b.tdc_m == pytest.approx(a.tdc_m, abs=5e-5)
        assert b.v_mid_m_s == pytest.approx(a.v_mid_m_s, rel=2e-3)


@pytest.mark.parametrize("v_m_s", [1.2e-38, 1e-6, 1.0])
def test_a_mid_stroke_hidden_in_a_gap_lies_in_the_gap(v_m_s):
    """However slowly the piston moves behind the gap, down to the least speed a frame can hold."""
    motion = Motion(-1, 10 * MS, -0.0625, -1.0)
    seen = observe(motion, 3, PistonSample(0.0625, v_m_s), 14 * MS)
    assert seen.passed.mid_stroke
    assert 10 * MS <= seen.motion.mid_t_ns <= 14 * MS


def test_noise_is_not_amplified():
    """x_dc moves by at most the noise of x plus half a tick's travel of the noise of v."""
    before, after = kicked(0.010), kicked(0.011)
    noise_x, noise_v = 1e-6, 1e-3
    _, clean = dead_centre_between(0, *before, MS, *after)
    for sx in (-1, 1):
        for sv in (-1, 1):
            one = (before[0] + sx * noise_x, before[1] + sv * noise_v)
            _, x_m = dead_centre_between(0, *one, MS, *after)
            assert abs(x_m - clean) <= 2.0 * noise_x + noise_v * 1e-3


@pytest.mark.parametrize("phase", [0.01 * k for k in range(1, 13)])
def test_mid_stroke_speed_of_a_sine_is_found_between_the_samples(phase):
    _, seen = follow(lambda t: swing(t, phase), range(200))
    found = [m for _, passed, m in seen if passed.mid_stroke]
    assert len(found) >= 7
    for motion in found:
        assert motion.v_mid_m_s == pytest.approx(X * OMEGA, rel=1e-6)
        turns = (OMEGA * motion.mid_t_ns * 1e-9 + phase) / math.pi
        assert turns % 1.0 == pytest.approx(0.5, abs=1e-5)


def test_crossing_stays_between_its_samples():
    t_ns, v = crossing_between(0, -1e-9, 1.0, MS, 1e-3, 1.0)
    assert 0 <= t_ns <= MS
    assert v == pytest.approx(1.0)
    assert crossing_between(0, 0.0, 0.0, MS, 0.0, 0.0) == (MS, 0.0)
    for v1 in (1e-250, -1e-306):
        t_ns, v = crossing_between(0, -0.01, v1, MS, 0.0, 0.0)
        assert 0 <= t_ns <= MS
        assert math.isfinite(v)


@pytest.mark.parametrize("v2", [-5e-324, -1e-300, -1e-6])
def test_dead_centre_of_a_piston_that_hardly_moves_lies_between_its_samples(v2):
    for x1, x2 in ((0.015, 0.015), (0.015, 0.0151), (0.0151, 0.015)):
        t_ns, x_m = dead_centre_between(0, x1, 0.0, MS, x2, v2)
        assert 0 <= t_ns <= MS
        assert x_m == x1


def test_dead_centre_and_mid_stroke_take_turns():
    _, seen = follow(swing, range(1, 200))
    kinds = [passed.dead_centre for _, passed, _ in seen]
    assert len(kinds) > 10
    assert all(a != b for a, b in pairwise(kinds))


def test_reversals_near_the_middle_are_no_dead_centres():
    def shiver(t):
        return 0.4e-3 * math.sin(300.0 * t), 0.12 * math.cos(300.0 * t)

    motion, seen = follow(shiver, range(200))
    assert [passed for _, passed, _ in seen if passed.dead_centre] == []
    assert motion.stroke == 0
    assert motion.tdc_m == 0.0


def test_reversal_that_never_came_past_the_middle_is_no_dead_centre():
    """The piston rebounds on the side from which it came."""
    motion, seen = follow(lambda t: (-0.010 - 0.002 * math.cos(100 * t), 0.2 * math.sin(100 * t)),
                          range(1, 60))  # fmt: skip
    rightward = [m for _, passed, m in seen if passed.dead_centre and m.side == 1]
    assert rightward == []
    assert abs(motion.x_m) > 0.007


def test_standing_piston_has_no_direction_and_passes_nothing():
    motion, seen = follow(lambda _: (0.001, 0.004), range(50))
    assert motion.direction == 0
    assert seen == []


def test_first_dead_centre_needs_no_history():
    _, seen = follow(swing, [20, 21, 22, 23, 24, 25, 26, 27])
    assert [passed.dead_centre for _, passed, _ in seen] == [True]


@pytest.mark.parametrize("rate_hz", [500, 1000, 5000])
@pytest.mark.parametrize("ahead_s", [0.002, 0.005, 0.010])
def test_prediction_of_the_dead_centre_is_right_where_the_motion_is_free(rate_hz, ahead_s):
    """What is left of the difference quotient's error is of second order in the tick."""
    h = 1.0 / rate_hz
    t = math.pi / OMEGA - ahead_s
    (_, v1), (x, v) = swing(t - h), swing(t)
    motion = Motion(direction=1, x_m=x, v_m_s=v, a_m_s2=(v - v1) / h)
    predicted = seconds_to_dead_centre(motion, h, OMEGA)
    assert predicted == pytest.approx(ahead_s, abs=0.1 * OMEGA * h * h)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("s", [0.03e-3, 0.4e-3, 0.97e-3])
@pytest.mark.parametrize("jerk", [-3e6, 0.0, 3e6])
def test_a_smooth_dead_centre_is_where_the_cubic_turns(side, s, jerk):
    """x = X - a t^2 / 2 + j t^3 / 6 about the turn at t = 0."""

    def at(t):
        x = 0.0155 - 0.5 * 2500.0 * t * t + jerk * t**3 / 6.0
        return side * x, side * (-2500.0 * t + 0.5 * jerk * t * t)

    t_ns, x = smooth_dead_centre_between(0, *at(-s), 1_000_000, *at(1e-3 - s))
    assert t_ns == pytest.approx(s * 1e9, abs=2)
    assert x == pytest.approx(side * 0.0155, abs=1e-12)
