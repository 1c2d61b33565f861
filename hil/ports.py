"""Ports: what the shells ask of the outside world. Adapters are in drivers/."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable


class Link(Protocol):
    """Carries batches (the frames of one tick) to the peer and back, in order.

    Neither method may run anybody else's Python in the loop's thread for longer than the call.
    """

    def send(self, batch: bytes, /) -> None:
        """Hand over one tick's frames; never blocks in real time.

        Raises: LinkError when the link is broken for good
        """

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None when there is none now."""

    def wait(self, timeout_ns: int, /) -> bytes | None:
        """Like `receive`, but wait for at most this long [ns]."""

    def peer_alive(self) -> bool:
        """Whether the peer takes part by now; cheap enough for every tick."""

    def wait_for_peer(self, timeout_s: float) -> None:
        """Return when the peer takes part.

        Raises: LinkError when it does not within the time
        """

    def counters(self) -> Mapping[str, int]:
        """Return what the link counted: dropped, send_full, errors."""

    def close(self) -> None:
        """Give everything back; the link cannot be used again."""


@runtime_checkable
class Noticing(Protocol):
    """A link whose bus reports errors of its own."""

    def notices(self) -> list[tuple[str, str]]:
        """Return (code, text) of what the bus reported since the last time."""


class Clock(Protocol):
    """Monotonic time; the only source of it."""

    def now_ns(self) -> int:
        """Return the time on a monotonic clock [ns]."""

    def sleep_until(self, deadline_ns: int, /) -> None:
        """Return at or just after a time on that clock [ns]."""


class Recorder(Protocol):
    """Takes complete log records; never blocks in real time."""

    def put(self, data: bytes, /) -> None:
        """Hand over the records of one tick; what finds no room is dropped and counted."""


class CommandSource(Protocol):
    """Where operator commands come from."""

    def poll(self) -> tuple[str, bytes] | None:
        """Return (origin, raw command) of the oldest command not yet taken, or None."""

    def answer(self, is_taken: bool, tick: int, text: str, /) -> None:
        """Tell who sent the command that was polled last what has become of it; never blocks."""


class StatusSink(Protocol):
    """Where a process says how it is, some ten times a second."""

    def publish(self, status: Mapping[str, object], /) -> None:
        """Publish; never blocks."""


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
