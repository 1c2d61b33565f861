"""Samples that physics does not allow are refused, and true ones never."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.observe.estimate import Motion
from controller.observe.plausibility import (
    AGREE_TO_BELIEVE,
    DISAGREES,
    HOT,
    JUMPS,
    KNOCKS,
    LEAPS,
    NAMES,
    NONE,
    OVERDUE,
    OVERSPEED,
    PEAK,
    POWER,
    PRESSURELESS,
    STANDS,
    UNBRAKED,
    UNHEARD_OF,
    fault_of,
    judge,
)
from controller.observe.possible import possible_of
from controller.observe.symptoms import watch
from hil.config.prototypes import NU

MS = 1_000_000
X, T_S = 0.0155, 0.025
V = X * math.pi / T_S
NAN = math.nan


def possible(period_ns=MS):
    return possible_of(NU, X, T_S, period_ns, 0.010, every_stroke_fires=True, force_n=110.0)


def truth(t_ns):
    w = math.pi / T_S
    return -X * math.cos(w * t_ns * 1e-9), X * w * math.sin(w * t_ns * 1e-9)


class Run:
    """A witness that sees a sine through a sensor."""

    def __init__(self, period_ns=MS, active=True):
        self.possible, self.active = possible(period_ns), active
        self.witness, self.motion = UNHEARD_OF, Motion()
        self.period_ns, self.t_ns = period_ns, 0
        self.refused, self.fault_ms = [], None

    def see(self, ticks, lie=lambda t_ns, x, v: (x, v)):
        for _ in range(ticks):
            x, v = lie(self.t_ns, *truth(self.t_ns))
            self.witness = judge(
                self.possible, self.witness, self.motion, self.t_ns, x, v, self.active
            )
            if self.witness.agreeing:
                self.refused.append(self.t_ns // self.period_ns)
            else:
                self.motion = Motion(1, self.t_ns, x, v)
            if self.fault_ms is None and fault_of(self.possible, self.witness) != NONE:
                self.fault_ms = self.t_ns / MS
            self.t_ns += self.period_ns
        return self


@pytest.mark.parametrize("period_ns", [50_000, 100_000, 200_000, MS, 2 * MS, 5 * MS, 10 * MS])
def test_the_engines_own_motion_is_believed_at_every_rate(period_ns):
    assert Run(period_ns).see(500_000_000 // period_ns).refused == []


@given(st.integers(0, 49), st.integers(1, 10))
def test_what_comes_after_a_silence_is_believed(begin, missing):
    run = Run().see(begin + 1)
    run.t_ns += missing * MS
    assert run.see(40).refused == []


LIES = {
    "x jumps": (lambda t, x, v: (x + 0.005, v), JUMPS),
    "x stuck": (lambda t, x, v: (0.004, v), JUMPS),
    "v stuck": (lambda t, x, v: (x, 1.0), NONE),
    "v nought": (lambda t, x, v: (x, 0.0), NONE),
    "x turned": (lambda t, x, v: (-x, v), JUMPS),
    "v turned": (lambda t, x, v: (x, -v), NONE),
    "x drifts": (lambda t, x, v: (x + 1e-9 * (t - 200 * MS) * 0.5, v), NONE),
    "v drifts": (lambda t, x, v: (x, v + 0.05e-6 * (t - 200 * MS)), DISAGREES),
}


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("phase", range(0, 50, 7))
def test_a_lie_is_known_within_a_stroke(lie, phase):
    says, _ = LIES[lie]
    run = Run().see(200 + phase)
    assert run.refused == []
    run.see(40, says)
    assert run.fault_ms is not None
    assert run.fault_ms - 200 - phase < 25


@pytest.mark.parametrize("phase", range(50))
@pytest.mark.parametrize("ticks", [1, 2, 5])
def test_a_short_jump_is_bridged_and_leaves_no_fault(phase, ticks):
    run = Run().see(200 + phase)
    run.see(ticks, lambda t, x, v: (x + 0.020, v)).see(60)
    assert run.fault_ms is None
    assert len(run.refused) >= ticks
    assert run.witness.agreeing == 0


def test_five_samples_that_agree_are_not_believed_while_the_engine_runs():
    run = Run().see(100)
    run.see(AGREE_TO_BELIEVE + 4, lambda t, x, v: (x + 0.010, v))
    assert len(run.refused) == AGREE_TO_BELIEVE + 4


def test_an_engine_that_is_off_believes_what_proves_itself():
    run = Run(active=False).see(100)
    run.see(20, lambda t, x, v: (0.010, 0.0))
    assert len(run.refused) == AGREE_TO_BELIEVE - 1


@pytest.mark.parametrize("phase", range(50))
def test_both_sensors_at_half_their_scale_are_known_by_the_leap_or_the_jump(phase):
    run = Run().see(200 + phase).see(12, lambda t, x, v: (0.5 * x, 0.5 * v))
    assert run.fault_ms is not None


def test_motoring_power_beyond_the_force_tells_of_more_speed_than_is_seen():
    slow = moving(v_m_s=0.4, x_m=0.0)
    assert watched(9, lambda _t: slow, power_w=-110.0 * 0.4, generates=False) is None
    assert watched(9, lambda _t: slow, power_w=-110.0 * 0.8, generates=False) == (3, POWER)


def test_a_leap_of_the_velocity_has_its_name():
    run = Run().see(213).see(12, lambda t, x, v: (x, 0.0))
    assert run.witness.doubt == LEAPS
    assert NAMES[LEAPS] == "velocity sensor jumps"


def moving(**changes):
    motion = {"direction": 1, "t_ns": 100 * MS, "x_m": -X, "v_m_s": 0.0, "v_mid_m_s": V,
              "dc_t_ns": 99 * MS, "stroke": 4}  # fmt: skip
    return Motion(**(motion | changes))


def watched(ticks, motion_at, power_w=NAN, generates=True, burnt=True):
    """The first fault of so many ticks, in milliseconds from the first, and which."""
    witness = UNHEARD_OF
    for tick in range(ticks):
        motion = motion_at(tick)
        witness, fault = watch(
            possible(), witness, motion, motion.v_m_s, power_w if tick % 2 else NAN, 810.0,
            motion.t_ns, generates, burnt, 0,
        )  # fmt: skip
        if fault:
            return tick, fault
    return None


def test_a_piston_that_stands_at_its_dead_centre_is_a_stuck_sensor():
    found = watched(20, lambda tick: moving(t_ns=(100 + tick) * MS))
    assert found == (7, STANDS)
    assert watched(20, lambda tick: moving(t_ns=(100 + tick) * MS), generates=False) is None


def test_power_without_speed_is_a_third_witness():
    assert watched(9, lambda tick: moving(t_ns=(100 + tick) * MS), power_w=300.0) == (3, POWER)


@pytest.mark.parametrize("scale", [0.05, 0.25, 1.0, 3.0, 10.0])
def test_no_load_step_is_taken_for_a_sensor(scale):
    for v in (0.01, 0.1, 0.5, 1.9):
        fast = moving(v_m_s=v, x_m=0.0)
        assert watched(5, lambda _t, m=fast: m, power_w=810.0 * v * v * scale) is None


def test_a_machine_that_takes_up_nothing_is_told_once_the_charge_is_known_to_have_burnt():
    fast = moving(v_m_s=1.9, x_m=0.0)
    assert watched(9, lambda _tick: fast, power_w=0.0) == (5, UNBRAKED)
    assert watched(9, lambda _tick: fast, power_w=0.0, burnt=False) is None


def test_a_stroke_without_an_end_is_overdue():
    found = watched(200, lambda tick: moving(t_ns=(100 + tick) * MS, v_m_s=1.0))
    assert found is not None
    assert found[1] == OVERDUE
    assert found[0] < 110


def test_every_fault_has_a_name():
    sensors = (JUMPS, LEAPS, DISAGREES, STANDS, POWER, OVERDUE, UNBRAKED)
    faults = (*sensors, PEAK, KNOCKS, OVERSPEED, HOT, PRESSURELESS)
    assert sorted(faults) == list(range(1, len(NAMES)))
    assert len(set(NAMES)) == len(NAMES)
