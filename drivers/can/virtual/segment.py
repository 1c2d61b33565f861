"""The cable of the virtual bus: sessions that meet on unix sockets in one directory a channel.

Whoever opens a channel listens on a socket of its own and connects to all that are there; opening
takes turns under a file lock, so that no two miss each other. No router, no multicast, nothing
beyond this machine.
"""

from __future__ import annotations

import fcntl
import itertools
import json
import mmap
import os
import struct
import time
from pathlib import Path
from typing import Final

import zenoh

from drivers.can.virtual.directory import folder_of, locked, node_names, sweep
from drivers.can.virtual.records import HEAD, MAGIC
from drivers.zenoh.node import give_back
from hil.errors import LinkError

SHARED_SIZE: Final = 1 << 14
"""Bytes that the processes of a channel share: a count of joins, and the model of the wire."""

_CAPACITY: Final = 1 << 14  # messages that wait to be taken; beyond it the oldest is lost
_MEET_S: Final = 0.25  # for a newcomer to be known; one that died meanwhile never will
_OPEN_S: Final = 10.0
_NAP_S: Final = 1e-4
_JOINS: Final = struct.Struct("<Q")
_numbers = itertools.count()


def _session_tree(socket: Path, others: list[Path], patience_us: int) -> str:
    """Return the configuration of one node's session.

    Parameters: patience_us : how long a send may wait for room before what it sends is lost
    """
    return json.dumps(
        {
            "mode": "peer",
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "open": {"return_conditions": {"connect_scouted": False, "declares": False}},
            "listen": {
                "endpoints": [f"unixsock-stream/{socket}"],
                "timeout_ms": 0,
                "exit_on_failure": True,
            },
            "connect": {
                "endpoints": [f"unixsock-stream/{other}" for other in others],
                "timeout_ms": 0,
                "exit_on_failure": False,
            },
            "transport": {
                "shared_memory": {"enabled": False},
                "link": {
                    "protocols": ["unixsock-stream"],
                    # A node that hangs must hold up nobody for long: it loses what has no room.
                    "tx": {
                        "queue": {
                            "size": {"real_time": 16},
                            "congestion_control": {"drop": {"wait_before_drop": patience_us}},
                        }
                    },
                },
            },
        }
    )


class Segment:
    """One node's end of the cable: what it publishes every other node of the channel gets.

    Raises: ConfigError when the channel cannot be, LinkError when the session does not open
    """

    def __init__(self, channel: str, *, patience_us: int = 20_000) -> None:
        self.channel = channel
        self.folder = folder_of(channel)
        self.name = f"{os.getpid()}-{next(_numbers)}"
        self.identity = int.from_bytes(os.urandom(8), "little")
        self.overruns = self.malformed = 0
        self._sent = 0
        self._counts: dict[int, int] = {}
        self._known: set[str] = {self.name}
        self._closed = False
        self._lock = os.open(self.folder / "lock", os.O_RDWR | os.O_CREAT, 0o600)
        os.ftruncate(self._lock, SHARED_SIZE)
        self.shared = mmap.mmap(self._lock, SHARED_SIZE)
        with locked(self._lock):
            self._join(patience_us)
            self._joins = _JOINS.unpack_from(self.shared)[0] + 1
            _JOINS.pack_into(self.shared, 0, self._joins)

    @property
    def lock(self) -> int:
        """The file whose lock guards the shared bytes."""
        return self._lock

    def _join(self, patience_us: int) -> None:
        """Open a session beside those that are there, and wait until they are connected."""
        others = sweep(self.folder)
        self._alive = os.open(self.folder / f"{self.name}.alive", os.O_RDWR | os.O_CREAT, 0o600)
        fcntl.flock(self._alive, fcntl.LOCK_EX | fcntl.LOCK_NB)
        socket = self.folder / f"{self.name}.sock"
        sockets = [self.folder / f"{name}.sock" for name in others]
        tree = _session_tree(socket, sockets, patience_us)
        try:
            self.session = zenoh.open(zenoh.Config.from_json5(tree))
        except zenoh.ZError as error:
            self._forget()
            raise LinkError(f"zenoh:{self.channel}: cannot open {socket}: {error}") from None
        key = f"hil-can/{self.channel}"
        self._subscriber = self.session.declare_subscriber(
            f"{key}/frames", zenoh.handlers.RingChannel(_CAPACITY)
        )
        self._handler = self._subscriber.handler
        self._publisher = self.session.declare_publisher(
            f"{key}/frames",
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        # After the subscriber: who sees the token delivers to it.
        self._token = self.session.liveliness().declare_token(f"{key}/alive/{self.name}")
        self._seen = self.session.liveliness().declare_subscriber(
            f"{key}/alive/*", zenoh.handlers.RingChannel(256), history=True
        )
        self._meet(others, _OPEN_S)

    def _meet(self, names: list[str], patience_s: float) -> None:
        """Wait until these nodes are connected, or are no more."""
        end_s = time.monotonic() + patience_s
        missing = set(names)
        while missing := missing - self._listen():
            if time.monotonic() > end_s:
                return
            time.sleep(_NAP_S)
            missing = {name for name in missing if (self.folder / f"{name}.alive").exists()}

    def _listen(self) -> set[str]:
        """Take note of who came and went; returns who is connected."""
        while (sample := self._seen.handler.try_recv()) is not None:
            name = str(sample.key_expr).rsplit("/", 1)[1]
            if sample.kind == zenoh.SampleKind.PUT:
                self._known.add(name)
            else:
                self._known.discard(name)
        return self._known

    def nodes(self) -> int:
        """Return how many nodes are on the channel by now, this one included."""
        return len(self._listen())

    def greet(self) -> None:
        """Let a node that has joined since the last time be connected before going on."""
        joins = _JOINS.unpack_from(self.shared)[0]
        if joins != self._joins:
            self._joins = joins
            self._meet(node_names(self.folder), _MEET_S)

    def publish(self, frames: bytes) -> None:
        """Send packed frames to all other nodes; never waits for one that hangs.

        Raises: LinkError when the segment is closed
        """
        self._sent += 1
        head = HEAD.pack(MAGIC, self.identity, self._sent & 0xFFFFFFFF)
        try:
            self._publisher.put(head + frames)
        except zenoh.ZError as error:
            raise LinkError(f"zenoh:{self.channel}: cannot send: {error}") from None

    def poll(self) -> bytes | None:
        """Return the oldest message not yet taken, its head included, or None."""
        while not self._closed and (sample := self._handler.try_recv()) is not None:
            payload = sample.payload.to_bytes()
            if len(payload) < HEAD.size or payload[:4] != MAGIC:
                self.malformed += 1
                continue
            _, sender, count = HEAD.unpack_from(payload)
            before = self._counts.get(sender)
            if before is not None:
                self.overruns += (count - before - 1) & 0xFFFFFFFF
            elif len(self._counts) > _CAPACITY:
                self._counts.clear()
            self._counts[sender] = count
            return payload
        return None

    def close(self) -> None:
        """Leave the channel; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        give_back(
            self._token.undeclare, self._subscriber.undeclare, self._publisher.undeclare,
            self._seen.undeclare, self.session.close,
        )  # fmt: skip
        with locked(self._lock):
            self._forget()
        self.shared.close()
        os.close(self._lock)

    def _forget(self) -> None:
        """Remove this node's files and let go of its lock."""
        for suffix in ("alive", "sock", "sock.lock"):
            (self.folder / f"{self.name}.{suffix}").unlink(missing_ok=True)
        os.close(self._alive)
