"""A plant that begins anew sends ticks that are over and were heard; one that lags does not."""

from __future__ import annotations

import pytest

from controller import follow


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now_ns = 1_000_000_000

    monkeypatch.setattr(follow.time, "monotonic_ns", lambda: Clock.now_ns)
    return Clock


def turns(clock, old, ticks, *, silent_every=0):
    """Turn after turn, 1 ms each: those of `ticks`, and others in which nothing has come."""
    for n, tick in enumerate(ticks):
        clock.now_ns += 1_000_000
        if silent_every and n % silent_every == 0:
            assert not old.go_on(tick, is_over=False)
        if old.go_on(tick, is_over=True):
            return n
    return None


@pytest.mark.parametrize("silent_every", [0, 1, 3])
def test_it_is_told_within_its_time_however_the_machine_stalls(clock, silent_every):
    old = follow.OldSamples(5000)
    told = turns(clock, old, range(400), silent_every=silent_every)
    assert told is not None
    assert told * 1_000_000 <= follow.ANEW_NS + 2_000_000


def test_a_plant_that_lags_is_followed(clock):
    old = follow.OldSamples(5000)
    assert turns(clock, old, range(5001, 6000), silent_every=2) is None
