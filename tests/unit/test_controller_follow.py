"""Old samples: a burst after a stall is passed over, a plant that began anew ends the process."""

import time
from types import SimpleNamespace

import pytest

from controller.follow import follow_in_real_time
from drivers.system.process import Stop
from hil.errors import RunError
from hil.ports import Link

PERIOD_NS = 1_000_000


class TickLoop:
    """Ticks as the controller's loop counts them; a batch is the number of its tick."""

    peer_timeout_s = 1.0
    params = SimpleNamespace(period_ns=PERIOD_NS)

    def __init__(self):
        self.tick = self.heard_tick = -1

    def turn(self, batch):
        if batch is None:
            self.tick += 1
        else:
            self.heard_tick = int.from_bytes(batch, "big")
            self.tick = max(self.tick, self.heard_tick)


class Samples(Link):
    """Gives what it holds, then nothing; `gap_s` lies before each."""

    def __init__(self, ticks, gap_s=0.0):
        self.left = list(ticks)
        self.gap_s = gap_s

    def wait(self, _timeout_ns):
        time.sleep(self.gap_s)
        tick = self.left.pop(0) if self.left else None
        return None if tick is None else tick.to_bytes(4, "big")

    def peer_alive(self):
        return True


def follow(samples, last_tick):
    loop = TickLoop()
    follow_in_real_time(loop, samples, PERIOD_NS, last_tick, Stop())
    return loop.tick


def test_a_burst_of_old_samples_after_a_stall_is_passed_over():
    stall = [None] * 40
    assert follow(Samples([0, 1, *stall, *range(2, 42), 42]), 42) == 42


def test_a_plant_that_began_anew_is_told():
    with pytest.raises(RunError, match="began anew after tick 5000"):
        follow(Samples([5000, *range(400)], gap_s=1e-3), 6000)


def test_a_plant_that_lags_for_long_is_the_same_one():
    """Its ticks are over, as those of a starved processor are, but each is a new one."""
    ahead = [None] * 500
    assert follow(Samples([0, *ahead, *range(1, 400), *range(400, 600)], gap_s=1e-3), 599) >= 599
