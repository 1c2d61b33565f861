"""Ports: what the shells ask of the outside world. Adapters are in drivers/ and derive from these.

Classes and no protocols, since a call of a compiled loop to a class's method costs a fiftieth.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from mypy_extensions import i64, mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class Link:
    """Carries batches (the frames of one tick) to the peer and back, in order.

    Neither method may run anybody else's Python in the loop's thread for longer than the call.
    """

    __slots__ = ()

    def send(self, batch: bytes, /) -> None:
        """Hand over one tick's frames; never blocks in real time.

        Raises: LinkError when the link is broken for good
        """
        raise NotImplementedError

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None when there is none now."""
        raise NotImplementedError

    def wait(self, timeout_ns: i64, /) -> bytes | None:
        """Like `receive`, but wait for at most this long [ns]."""
        raise NotImplementedError

    def peer_alive(self) -> bool:
        """Whether the peer takes part by now; cheap enough for every tick."""
        raise NotImplementedError

    def wait_for_peer(self, timeout_s: float, /) -> None:
        """Return when the peer takes part.

        Raises: LinkError when it does not within the time
        """
        raise NotImplementedError

    def reports(self) -> bool:
        """Whether its bus reports errors of its own, by `notices`."""
        return False

    def notices(self) -> list[tuple[str, str]]:
        """Return (code, text) of what the bus reported since the last time."""
        return []

    def counters(self) -> Mapping[str, int]:
        """Return what the link counted: dropped, send_full, errors."""
        return {}

    def close(self) -> None:
        """Give everything back; the link cannot be used again."""
        raise NotImplementedError


@mypyc_attr(allow_interpreted_subclasses=True)
class Clock:
    """Monotonic time; the only source of it."""

    __slots__ = ()

    def now_ns(self) -> i64:
        """Return the time on a monotonic clock [ns]."""
        raise NotImplementedError

    def sleep_until(self, deadline_ns: i64, /) -> None:
        """Return at or just after a time on that clock [ns]."""
        raise NotImplementedError


@mypyc_attr(allow_interpreted_subclasses=True)
class Recorder:
    """Takes complete log records; never blocks in real time."""

    __slots__ = ()

    def put(self, data: bytes, /) -> None:
        """Hand over the records of one tick; what finds no room is dropped and counted."""
        raise NotImplementedError


@mypyc_attr(allow_interpreted_subclasses=True)
class CommandSource:
    """Where operator commands come from."""

    __slots__ = ()

    def poll(self) -> tuple[str, bytes] | None:
        """Return (origin, raw command) of the oldest command not yet taken, or None."""
        raise NotImplementedError

    def answer(
        self, is_taken: bool, tick: int, text: str, values: Mapping[str, Any] | None = None, /
    ) -> None:
        """Tell who sent the command that was polled last what has become of it; never blocks.

        Parameters: values : of parameters that were asked for
        """


@mypyc_attr(allow_interpreted_subclasses=True)
class StatusSink:
    """Where a process says how it is, some ten times a second."""

    __slots__ = ()

    def publish(self, status: Mapping[str, object], /) -> None:
        """Publish; never blocks."""
        raise NotImplementedError


class Ports(Protocol):
    """What one process has of the outside world."""

    @property
    def link(self) -> Link:
        """The way to the peer."""

    @property
    def commands(self) -> CommandSource:
        """Where operator commands come from."""

    @property
    def status(self) -> StatusSink:
        """Where the process says how it is."""
