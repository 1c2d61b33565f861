"""A link over Zenoh: the frames of one tick are one put; what arrives is polled, never called back.

A callback would run on one of Zenoh's threads and fight the loop for the interpreter; a handler
without timeouts is all the library offers beside it. So `wait` polls: an empty poll costs 0.2 us.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Final

import zenoh

from drivers.polling import LockstepPolling, RealTimePolling
from drivers.zenoh.node import PEER, ZenohNode, give_back, is_heard
from hil.errors import LinkError
from hil.ports import Link

_CAPACITY: Final = 4096  # batches that wait to be taken; beyond it the oldest is lost
_PEER_POLL_S: Final = 2e-3


class ZenohLink(Link):
    """One end of the link: publishes on its own frames key, polls the peer's."""

    def __init__(self, node: ZenohNode, period_ns: int) -> None:
        self._node = node
        self._peer = PEER[node.role]
        block = zenoh.CongestionControl.BLOCK if node.lockstep else zenoh.CongestionControl.DROP
        self._publisher = node.session.declare_publisher(
            node.key(f"frames/{node.role}"),
            congestion_control=block,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._subscriber = node.session.declare_subscriber(
            node.key(f"frames/{self._peer}"), zenoh.handlers.RingChannel(_CAPACITY)
        )
        self._handler = self._subscriber.handler
        lockstep = LockstepPolling(self.receive) if node.lockstep else None
        self._polling = lockstep or RealTimePolling(self.receive, period_ns)
        self._sent = self._received = self._errors = 0
        self._closed = False

    def send(self, batch: bytes, /) -> None:
        """Publish one tick's frames; in real time drops them rather than wait.

        Raises: LinkError when the session is closed
        """
        try:
            self._publisher.put(batch)
        except zenoh.ZError as error:
            self._errors += 1
            raise LinkError(f"zenoh: {self._node.role} cannot send: {error}") from None
        self._sent += 1

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None."""
        if self._closed or (sample := self._handler.try_recv()) is None:
            return None
        self._received += 1
        return sample.payload.to_bytes()

    def wait(self, timeout_ns: int, /) -> bytes | None:
        """Like `receive`, but wait for at most this long [ns]."""
        batch = self.receive()
        if batch is not None or timeout_ns <= 0 or self._closed:
            return batch
        return self._polling.wait(timeout_ns)

    def peer_alive(self) -> bool:
        """Whether the peer's process takes part; false at once when it closes or is killed."""
        return self._peer in self._node.alive()

    def wait_for_peer(self, timeout_s: float) -> None:
        """Return when the peer takes part, fits, and gets what is sent to it.

        Raises: LinkError when it does not within the time; ConfigError naming what does not fit
        """
        end_ns = time.monotonic_ns() + round(timeout_s * 1e9)
        while not (self._node.is_met() and is_heard(self._publisher)):
            if time.monotonic_ns() > end_ns:
                config = self._node.config
                plant = self._peer == "plant"
                endpoint = config.plant_endpoint if plant else config.controller_endpoint
                absent = f"no {self._peer} at {endpoint} after {timeout_s:g} s"
                raise LinkError(absent + self._node.absence())
            time.sleep(_PEER_POLL_S)
        self._node.ready()

    def reports(self) -> bool:
        """Whether there is something to notice: who else comes to the session."""
        return True

    def notices(self) -> list[tuple[str, str]]:
        """Return (code, text) of what happened around the session since the last time."""
        return self._node.notices()

    def counters(self) -> Mapping[str, int]:
        """Return batches sent and received, and errors; what was lost shows in the tick numbers."""
        return {"sent": self._sent, "received": self._received, "errors": self._errors}

    def close(self) -> None:
        """Undeclare both keys; a second call does nothing."""
        if not self._closed:
            self._closed = True
            give_back(self._subscriber.undeclare, self._publisher.undeclare)
