"""The sleeping policy: absolute deadlines, skipped slots counted, never a backlog."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.polling import WakeUp
from drivers.system.clock import SystemClock
from hil.errors import ConfigError
from hil.pacing import LockstepPacer, RealTimePacer, Slot, next_slot
from hil.ports import Clock

PERIOD = 1_000_000
times = st.integers(0, 10**12)
periods = st.integers(1, 10**8)
ticks = st.integers(0, 10**6)


class FakeClock(Clock):
    """A clock that only moves when it is told to, and wakes this late."""

    def __init__(self, now_ns=5_000, late_ns=0):
        self.time_ns = now_ns
        self.late_ns = late_ns
        self.slept_until = []

    def now_ns(self):
        return self.time_ns

    def sleep_until(self, deadline_ns, /):
        self.slept_until.append(deadline_ns)
        self.time_ns = max(self.time_ns, deadline_ns + self.late_ns)


@given(times, periods, ticks, times)
def test_the_slot_to_run_is_never_over_and_never_before_the_one_asked_for(start, period, tick, now):
    run, missed = next_slot(start, period, tick, now)
    assert run == tick + missed
    assert missed >= 0
    assert now < start + (run + 1) * period


@given(times, periods, ticks, times)
def test_no_slot_is_skipped_that_could_still_run(start, period, tick, now):
    run, missed = next_slot(start, period, tick, now)
    assert missed == 0 or start + run * period <= now


def test_deadlines_are_absolute_however_late_each_wake_up_is():
    clock = FakeClock(late_ns=70_000)
    pacer = RealTimePacer(clock, PERIOD)
    slots = [pacer.wait(tick) for tick in range(5)]
    assert clock.slept_until == [5_000 + tick * PERIOD for tick in range(1, 5)]
    assert [slot.scheduled_ns for slot in slots] == [tick * PERIOD for tick in range(5)]
    assert [slot.woke_ns for slot in slots[1:]] == [tick * PERIOD + 70_000 for tick in range(1, 5)]
    assert all(slot.missed == 0 for slot in slots)


def test_an_overrun_within_the_next_slot_runs_it_late_without_sleeping():
    clock = FakeClock()
    pacer = RealTimePacer(clock, PERIOD)
    pacer.wait(0)
    clock.time_ns += 1_300_000
    assert pacer.wait(1) == Slot(1, PERIOD, 1_300_000, 0)
    assert clock.slept_until == []


def test_slots_that_passed_are_skipped_and_counted_and_the_next_one_is_on_time():
    clock = FakeClock()
    pacer = RealTimePacer(clock, PERIOD)
    pacer.wait(0)
    clock.time_ns += 3_400_000
    assert pacer.wait(1) == Slot(3, 3 * PERIOD, 3_400_000, 2)
    assert pacer.wait(4) == Slot(4, 4 * PERIOD, 4 * PERIOD, 0)


@given(st.lists(st.integers(0, 5 * PERIOD), min_size=1, max_size=40))
def test_every_tick_is_either_run_or_counted_as_missed(work_ns):
    clock = FakeClock()
    pacer = RealTimePacer(clock, PERIOD)
    tick, run, missed = 0, 0, 0
    for work in work_ns:
        slot = pacer.wait(tick)
        assert slot.tick == tick + slot.missed
        assert slot.woke_ns - slot.scheduled_ns < PERIOD
        run, missed, tick = run + 1, missed + slot.missed, slot.tick + 1
        clock.time_ns += work
    assert run + missed == tick


def test_a_driven_process_starts_its_time_at_the_tick_it_first_sees():
    clock = FakeClock()
    pacer = RealTimePacer(clock, PERIOD)
    assert pacer.now_ns() == 0
    pacer.start(40)
    clock.time_ns += 250
    assert pacer.now_ns() == 40 * PERIOD + 250


def test_lockstep_time_is_the_tick_and_nothing_else():
    pacer = LockstepPacer(PERIOD, patience_ns=7)
    assert pacer.wait(12) == Slot(12, 12 * PERIOD, 12 * PERIOD, 0)
    assert pacer.now_ns() == 12 * PERIOD
    pacer.start(3)
    assert (pacer.now_ns(), pacer.patience_ns, pacer.period_ns) == (3 * PERIOD, 7, PERIOD)


@pytest.mark.parametrize("spin_s", [0.0, 150e-6])
def test_the_system_clock_never_returns_early(spin_s):
    clock = SystemClock(spin_s)
    for ahead_ns in (-1_000, 0, 20_000, 400_000):
        deadline = clock.now_ns() + ahead_ns
        clock.sleep_until(deadline)
        assert clock.now_ns() >= deadline


def test_the_system_clock_is_the_monotonic_one():
    assert abs(SystemClock().now_ns() - time.clock_gettime_ns(time.CLOCK_MONOTONIC)) < 10**9


@pytest.mark.parametrize("spin_s", [-1e-9, 3e-3, float("nan")])
def test_a_spin_out_of_range_is_refused(spin_s):
    with pytest.raises(ConfigError, match=r"realtime\.spin_s = .*accepted 0 to 0\.002 s"):
        SystemClock(spin_s)


def test_a_sleep_ends_as_early_as_nineteen_of_twenty_wake_ups_need():
    wake_up = WakeUp(60_000)
    for k in range(20_000):  # late by 10 to 40 us, evenly; now and then a stall
        wake_up.woke(9_000_000 if k % 500 == 0 else 10_000 + k * 7919 % 30_000)
    assert wake_up.early_ns == pytest.approx(38_500, abs=8_000)


def test_no_stall_makes_a_loop_spin_longer_than_it_may():
    wake_up = WakeUp(30_000)
    for _ in range(100):
        wake_up.woke(50_000_000)
    assert wake_up.early_ns == 30_000
