"""The loop from its first sample to its last: in lockstep with the plant, or by the clock."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final, Protocol

from controller.duty import Duty
from controller.loop import ControllerLoop
from hil.errors import PEER_LOST, RunError
from hil.exchange import await_batch
from hil.ports import Link

FIRST_SLICE_NS: Final = 200_000_000
ANEW_NS: Final = 250_000_000
"""A stall lets old samples come in a burst; when none but old ones come for so long, their plant is
another one than before."""


class Stop(Protocol):
    """A request to end."""

    @property
    def requested(self) -> bool:
        """Whether it was made."""


def follow_in_lockstep(
    loop: ControllerLoop, link: Link, patience_ns: int, last_tick: int, stop: Stop
) -> None:
    """Answer every sample; when the plant is gone, step without one until the safe state."""
    while loop.tick < last_tick and not stop.requested:
        batch = await_batch(link, patience_ns)
        if batch is None:
            break
        loop.turn(batch)
    else:
        return
    step_alone(loop, link)


def step_alone(loop: ControllerLoop, link: Link) -> bool:
    """Step without samples until the safe state, whose orders a plant that is there still hears."""
    for _ in range(loop.params.bounds.stale_ticks):
        link.wait(loop.params.period_ns)
        loop.turn(None)
    return True


def follow_in_real_time(
    loop: ControllerLoop, link: Link, patience_ns: int, last_tick: int, stop: Stop,
    duty: Duty | None = None,
) -> None:  # fmt: skip
    """Answer every sample, and a tick whose sample has not come after 1.5 periods without it.

    Raises: RunError when the plant never sends, or begins anew
    """
    period_ns = loop.params.period_ns
    first = await_first(loop, link, stop)
    if first is None:
        return
    loop.turn(first)
    if duty is not None:
        duty.begin(loop)
    wait_ns, old = patience_ns, OldSamples(loop.heard_tick)
    while loop.tick < last_tick and not stop.requested:
        batch = link.wait(wait_ns)
        before = loop.tick
        loop.turn(batch)
        wait_ns = patience_ns if batch is not None else period_ns
        if old.go_on(loop.heard_tick, is_over=0 <= before == loop.tick):
            raise RunError(f"plant began anew after tick {loop.tick}")
        if duty is not None and loop.tick >= duty.next_tick:
            duty.attend(loop)


class OldSamples:
    """How long nothing but samples of ticks that are over, and were heard before, has come.

    A plant that lags sends ticks that are over, too, but never one again.
    """

    def __init__(self, newest_tick: int) -> None:
        self._since_ns = 0
        self._newest_tick = newest_tick

    def go_on(self, heard_tick: int, *, is_over: bool) -> bool:
        """Take note of a turn; returns whether it has gone on for too long.

        A turn without a sample tells neither one nor the other: a machine that stalls has many.
        """
        if heard_tick > self._newest_tick:
            self._newest_tick = heard_tick
            self._since_ns = 0
            return False
        if not is_over:
            return False
        now_ns = time.monotonic_ns()
        self._since_ns = self._since_ns or now_ns
        return now_ns - self._since_ns > ANEW_NS


def await_first(loop: ControllerLoop, link: Link, stop: Stop) -> bytes | None:
    """Return the first batch, None when asked to end before it.

    Raises: RunError when the plant never sends
    """
    left_ns = round(1e9 * loop.peer_timeout_s)
    while left_ns > 0 and not stop.requested:
        first = await_batch(link, min(left_ns, FIRST_SLICE_NS))
        if first is not None:
            return first
        left_ns -= FIRST_SLICE_NS
    if stop.requested:
        return None
    raise RunError("plant sent no sample")


def raise_if_lost(loop: ControllerLoop) -> None:
    """A run that ended without its plant did not end well.

    Raises: RunError
    """
    stale = loop.state.stale
    if stale >= loop.params.bounds.stale_ticks:
        raise RunError(f"plant {PEER_LOST} sample in the last {stale} ticks")


def facts(loop: ControllerLoop, link: Link) -> dict[str, Any]:
    """How it went, for the summary."""
    reception = loop.reception
    counters: Mapping[str, int] = link.counters()
    return {
        "ticks": loop.tick + 1,
        "mode": loop.state.mode.name.lower(),
        "reception": reception.decoder.counts()._asdict(),
        "doubted": {
            "out_of_step": reception.out_of_step, "implausible": reception.implausible,
        },
        "link": dict(counters),
    }  # fmt: skip
