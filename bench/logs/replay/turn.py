"""One turn of a loop, as a log has it."""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from hil.values import Value


@final
class Turn(Value):
    """What came in, when, and what was put.

    first_tick, tick : first and last tick that it stepped, -1 when it stepped none
    times_ns : what the pacer was asked, in order
    used_tick : what /timing says of the last tick
    snapshot : the state behind it and the tick that comes next, if it is there
    """

    __slots__ = (
        "first_tick", "tick", "scheduled_ns", "times_ns", "used_tick", "batches", "command",
        "snapshot", "recorded",
    )  # fmt: skip

    def __init__(
        self, first_tick: i64, tick: i64, scheduled_ns: i64, times_ns: tuple[int, ...],
        used_tick: i64, batches: tuple[bytes, ...], command: tuple[str, bytes] | None,
        snapshot: tuple[int, str] | None, recorded: bytes,
    ) -> None:  # fmt: skip
        self.first_tick = first_tick
        self.tick = tick
        self.scheduled_ns = scheduled_ns
        self.times_ns = times_ns
        self.used_tick = used_tick
        self.batches = batches
        self.command = command
        self.snapshot = snapshot
        self.recorded = recorded
