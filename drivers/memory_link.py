"""A link inside one process: what one end sends the other receives, with nothing in between."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mypy_extensions import i64

from hil.errors import LinkError
from hil.ports import Link


def nothing() -> None:
    """Stand in for a peer's turn where none is set."""


class MemoryLink(Link):
    """One end of a pair.

    `on_send` runs at the end of every `send`: where plant and controller share a thread it is the
    controller's turn, so that its answer is there when the plant looks for it.
    """

    __slots__ = ("closed", "_dropped", "inbox", "peer", "_sent", "_taken", "on_send")

    def __init__(self) -> None:
        self.inbox: list[bytes] = []
        self.peer = self
        self.closed = False
        self._sent = self._taken = self._dropped = 0
        self.on_send: Callable[[], None] = nothing

    def send(self, batch: bytes, /) -> None:
        """Put a batch into the peer's hands and let it have its turn.

        Raises: LinkError when this end is closed
        """
        peer = self.peer
        if self.closed:
            raise LinkError("memory link: send on a closed link")
        if peer.closed:
            self._dropped += 1
            return
        peer.inbox.append(batch)
        self._sent += 1
        self.on_send()

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None."""
        if not self.inbox:
            return None
        self._taken += 1
        return self.inbox.pop(0)

    def wait(self, _timeout_ns: i64, /) -> bytes | None:
        """Like `receive`: on one thread nothing can arrive while it waits."""
        return self.receive()

    def peer_alive(self) -> bool:
        """Whether the other end is still open."""
        return not self.peer.closed

    def wait_for_peer(self, _timeout_s: float) -> None:
        """Return at once: both ends exist from the start.

        Raises: LinkError when the peer is closed
        """
        if not self.peer_alive():
            raise LinkError("memory link: the peer is closed")

    def counters(self) -> Mapping[str, int]:
        """Return batches sent, received and dropped (sent to a closed peer)."""
        return {"sent": self._sent, "received": self._taken, "dropped": self._dropped}

    def close(self) -> None:
        """Close this end; what it has not taken is gone."""
        self.closed = True
        self.inbox.clear()


def memory_pair() -> tuple[MemoryLink, MemoryLink]:
    """Return the plant's end and the controller's end."""
    plant, controller = MemoryLink(), MemoryLink()
    plant.peer, controller.peer = controller, plant
    return plant, controller
