"""When a polled link sleeps, and that it learns its peer's phase."""

import time

from drivers.polling import ArrivalClock, LockstepPolling, RealTimePolling

T = 1_000_000


def test_the_phase_follows_the_earliest_arrivals():
    clock = ArrivalClock(T)
    for k in range(20):
        clock.arrived(5 * T + k * T + (400_000 if k == 10 else 0))
    assert abs(clock.due_ns - 25 * T) < 20_000


def test_after_silence_the_next_slot_is_looked_to():
    clock = ArrivalClock(T)
    clock.arrived(5 * T)
    clock.missed(8 * T + 1)
    assert clock.due_ns == 9 * T


def test_what_was_there_already_is_looked_for_sooner_and_in_the_end_learnt_anew():
    clock = ArrivalClock(T)
    clock.arrived(1000 * T)
    clock.overslept()
    assert 1001 * T < clock.due_ns < 1002 * T
    for _ in range(4):
        clock.overslept()
    assert clock.due_ns == 0


def test_waiting_ends_with_the_batch_or_in_time():
    batches = [None, None, b"a"]
    for polling in (LockstepPolling(take_of(batches)), RealTimePolling(take_of(batches), T)):
        assert polling.wait(50 * T) == b"a"
        begin = time.monotonic_ns()
        assert polling.wait(2 * T) is None
        assert time.monotonic_ns() - begin >= 2 * T


def take_of(batches):
    left = list(batches)
    return lambda: left.pop(0) if left else None
