"""A link through shared memory (iceoryx2), for two processes on one machine; it is polled.

Presence, commands and status stay on a Zenoh node: a killed peer is noticed there at once, and
the endpoints of the node keep two pairs on one machine apart. What belongs to the queues is this
user's alone (drivers/shm/memory.py).
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from drivers.polling import LockstepPolling, RealTimePolling
from drivers.shm import memory
from drivers.zenoh.node import PEER, ZenohNode
from hil.errors import LinkError, MissingExtraError
from hil.ports import Link

try:
    import iceoryx2 as iox
except ImportError:
    iox = None

BATCH_MAX_BYTES: Final = 1024
_CAPACITY: Final = 2048  # batches that wait to be taken; beyond it the oldest is lost
MARGIN_BYTES: Final = 1 << 20
"""For what belongs to the queues beside the batches themselves."""

QUEUE_BYTES: Final = 5 << 20
"""The most that one direction's batches take: 4.4 MB."""

_PEER_POLL_S: Final = 2e-3
_CLEAN_UP_S: Final = 1.0


def service_name(node: ZenohNode, sender: str) -> str:
    """Return the name of one direction; other endpoints are another pair, with other names."""
    config = node.config
    pair = f"{config.plant_endpoint} {config.controller_endpoint}".encode()
    return f"hil/{config.engine}/{hashlib.sha256(pair).hexdigest()[:16]}/frames/{sender}"


def open_node() -> Any:  # noqa: ANN401
    """Return a node of the shared memory, after removing what killed processes left in it.

    Raises: MissingExtraError without the library, LinkError when there is no shared memory,
        ConfigError when the directory for it will not do
    """
    if iox is None:
        raise MissingExtraError("iceoryx2", "shm", "link.kind = 'shm'")
    iox.set_log_level(iox.LogLevel.Fatal)
    config = iox.config.default()
    config.global_cfg.prefix = iox.FileName.new(memory.prefix())
    config.global_cfg.root_path = iox.Path.new(str(memory.root()))
    memory.demand(memory.prefix(), MARGIN_BYTES)
    with _told("cannot join shared memory"):
        builder = iox.NodeBuilder.new().config(config)
        quiet = builder.signal_handling_mode(iox.SignalHandlingMode.Disabled)
        node = quiet.create(iox.ServiceType.Ipc)
        node.blocking_cleanup_dead_nodes(iox.Duration.from_secs_f64(_CLEAN_UP_S))
    memory.close_to_others(memory.prefix())
    return node


@contextlib.contextmanager
def _told(what: str) -> Any:  # noqa: ANN401
    """Put an error of the library, whose classes are many, into one of ours."""
    try:
        yield
    except Exception as error:
        if not type(error).__module__.startswith("iceoryx2"):
            raise
        raise LinkError(f"shm: {what}: {error or type(error).__name__}") from None


class ShmLink(Link):
    """One end of the link: publishes in its own direction, polls the peer's.

    Raises: MissingExtraError without iceoryx2, LinkError when shared memory is not to be had
    """

    def __init__(self, presence: ZenohNode, period_ns: int) -> None:
        self._presence = presence
        self._side = presence.role
        self._peer = PEER[presence.role]
        self._node = open_node()
        memory.demand(memory.prefix(), QUEUE_BYTES)
        with _told(f"{self._side} cannot open its frames"):
            self._out = self._service(self._side)
            self._in = self._service(self._peer)
            self._publisher = self._out.publisher_builder().initial_max_slice_len(
                BATCH_MAX_BYTES
            ).create()  # fmt: skip
            self._subscriber = self._in.subscriber_builder().buffer_size(_CAPACITY).create()
        memory.reserve(memory.prefix())
        lockstep = presence.lockstep
        polling = LockstepPolling(self.receive) if lockstep else None
        self._polling = polling or RealTimePolling(self.receive, period_ns)
        self._sent = self._received = self._unheard = 0
        self._closed = False

    def _service(self, sender: str) -> Any:  # noqa: ANN401
        """Open or create one direction."""
        name = iox.ServiceName.new(service_name(self._presence, sender))
        kind = self._node.service_builder(name).publish_subscribe(iox.Slice[ctypes.c_uint8])
        # A second end of either kind is a process that was killed and is not yet removed.
        sized = kind.max_publishers(2).max_subscribers(2).max_nodes(8)
        queued = sized.enable_safe_overflow(True).subscriber_max_buffer_size(_CAPACITY)
        return queued.history_size(0).open_or_create()

    def send(self, batch: bytes, /) -> None:
        """Put one tick's frames into the peer's queue; where it is full the oldest is lost.

        Raises: LinkError when this end is closed or the batch is too long
        """
        if self._closed:
            raise LinkError(f"shm: {self._side} cannot send: the link is closed")
        size = len(batch)
        if size > BATCH_MAX_BYTES:
            raise LinkError(f"shm: cannot send {size} bytes, accepted up to {BATCH_MAX_BYTES}")
        # One byte ahead of the frames, since an empty loan is no sample.
        loan = self._publisher.loan_slice_uninit(size + 1)
        ctypes.memmove(loan.payload_ptr, b"\0" + batch, size + 1)
        if loan.assume_init().send():
            self._sent += 1
        else:
            self._unheard += 1

    def receive(self) -> bytes | None:
        """Return the oldest batch not yet taken, or None."""
        if self._closed or (sample := self._subscriber.receive()) is None:
            return None
        payload = sample.payload()
        batch = ctypes.string_at(payload.as_ptr() + 1, payload.len() - 1)
        sample.delete()
        self._received += 1
        return batch

    def wait(self, timeout_ns: int, /) -> bytes | None:
        """Like `receive`, but wait for at most this long [ns]."""
        batch = self.receive()
        if batch is not None or timeout_ns <= 0 or self._closed:
            return batch
        return self._polling.wait(timeout_ns)

    def peer_alive(self) -> bool:
        """Whether the peer's process takes part; false at once when it closes or is killed."""
        return self._peer in self._presence.alive()

    def wait_for_peer(self, timeout_s: float) -> None:
        """Return when the peer takes part, fits, and gets what is sent to it.

        Raises: LinkError when it does not within the time; ConfigError naming what does not fit
        """
        end_ns = time.monotonic_ns() + round(timeout_s * 1e9)
        while not (self._presence.is_met() and self._is_heard()):
            if time.monotonic_ns() > end_ns:
                absent = f"shm: no {self._peer} after {timeout_s:g} s"
                raise LinkError(absent + self._presence.absence())
            time.sleep(_PEER_POLL_S)
        memory.reserve(memory.prefix())
        self._presence.ready()

    def _is_heard(self) -> bool:
        """Whether the peer's end of both queues is there."""
        ends = self._out.dynamic_config.number_of_subscribers
        back = self._in.dynamic_config.number_of_publishers
        return bool(ends and back)

    def reports(self) -> bool:
        """Whether there is something to notice: who else comes to the session."""
        return True

    def notices(self) -> list[tuple[str, str]]:
        """Return (code, text) of what happened around the session since the last time."""
        return self._presence.notices()

    def counters(self) -> Mapping[str, int]:
        """Return batches sent and received, and those sent while nobody listened."""
        return {"sent": self._sent, "received": self._received, "unheard": self._unheard}

    def close(self) -> None:
        """Give the queues back; a second call does nothing."""
        if not self._closed:
            self._closed = True
            _delete(self._subscriber, self._publisher)
            # The node's files go with the last reference to it and to its services.
            del self._subscriber, self._publisher, self._in, self._out, self._node


def _delete(*parts: Any) -> None:  # noqa: ANN401
    """Release one after the other, whatever became of the shared memory meanwhile."""
    deletes: list[Callable[[], object]] = [part.delete for part in parts]
    for delete in deletes:
        with contextlib.suppress(Exception):
            delete()
