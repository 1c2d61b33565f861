"""Samples that physics does not allow are refused, and true ones are not refused for long."""

import math

from hypothesis import given
from hypothesis import strategies as st

from controller.observe.plausibility import AGREE_TO_BELIEVE, CLEAR, fits, judge

MS = 1_000_000


def motion(t_ns, amplitude=0.0155, hz=20.0):
    w = 2 * math.pi * hz
    return amplitude * math.sin(w * t_ns * 1e-9), amplitude * w * math.cos(w * t_ns * 1e-9)


@given(st.integers(0, 10**9), st.integers(1, 20), st.sampled_from([50_000, 200_000, MS, 4 * MS]))
def test_the_engines_own_motion_is_believed(t_ns, gap, period_ns):
    later = t_ns + gap * period_ns
    assert fits(t_ns, *motion(t_ns), later, *motion(later))


@given(st.floats(-0.08, 0.08), st.floats(-8.0, 8.0))
def test_what_is_accepted_is_near_where_the_piston_can_be(x, v):
    if fits(0, 0.0, 1.7, MS, x, v):
        assert abs(x - 0.5e-3 * (1.7 + v)) <= 2.0001e-3
        assert abs(v - 1.7) <= 6.5


def test_one_wild_sample_is_refused_and_the_next_true_one_believed():
    credence, believed = judge(CLEAR, 0, 0.0, 1.7, MS, 0.05, 1.7)
    assert not believed
    credence, believed = judge(credence, 0, 0.0, 1.7, 2 * MS, 0.0034, 1.69)
    assert believed
    assert credence == CLEAR


def test_a_new_truth_is_believed_once_it_has_proved_itself():
    credence, refused = CLEAR, 0
    for tick in range(1, 10):
        credence, believed = judge(credence, 0, 0.0, 0.0, tick * MS, 0.05, 0.0)
        if believed:
            break
        refused += 1
    assert refused == AGREE_TO_BELIEVE - 1


def test_wild_samples_that_contradict_each_other_are_never_believed():
    credence = CLEAR
    for tick in range(1, AGREE_TO_BELIEVE + 2):
        x = 0.06 if tick % 2 else -0.06
        credence, believed = judge(credence, 0, 0.0, 0.0, tick * MS, x, 0.0)
        assert not believed


def test_the_first_sample_has_nothing_to_fit():
    assert judge(CLEAR, -1, 0.0, 0.0, 0, 0.07, 7.9) == (CLEAR, True)


def test_contact_with_the_head_is_believed_in_the_next_tick():
    """v = 2 m/s turned over within a tick: refused at most once."""
    credence, believed = judge(CLEAR, 0, 0.0195, 2.0, MS, 0.0190, -1.5)
    if not believed:
        _, believed = judge(credence, 0, 0.0195, 2.0, 2 * MS, 0.0175, -1.5)
    assert believed
