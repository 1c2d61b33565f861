"""A live view of what a process records, for any process that may enter its directory of sockets.

A recorder hands its ring, to be read only, to whoever connects to the socket beside that of its
process. The reader copies out of the ring at its own pace and leaves no trace there: the loop
takes no part in it, and a reader that is too slow loses records, nobody else does.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from drivers.recorder.ring import Observer
from hil.errors import LinkError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_DESCRIPTION_BYTES: Final = 1 << 18
_MOST_READERS: Final = 32
_PATIENCE_S: Final = 10.0


def listen(path: Path) -> socket.socket | None:
    """Return a socket at which a recorder can be joined; None where one is listening already."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        if _is_served(path):
            raise FileExistsError
        path.unlink(missing_ok=True)
        listener.bind(str(path))
        listener.listen(_MOST_READERS)
    except OSError:
        listener.close()
        return None
    return listener


def _is_served(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        return probe.connect_ex(str(path)) == 0


def remove(listener: socket.socket) -> None:
    """Close a socket of `listen`, and take it away."""
    with listener, contextlib.suppress(OSError):
        Path(listener.getsockname()).unlink()


class Door:
    """The recorder's side: hands out its ring; by its end readers see that nothing more comes."""

    def __init__(self, listener: socket.socket, ring_fd: int, config: Mapping[str, Any]) -> None:
        self._listener = listener
        self._listener.setblocking(False)
        self._ring = os.open(f"/proc/self/fd/{ring_fd}", os.O_RDONLY)
        told = {name: config[name] for name in ("metadata", "schemas", "channels")}
        self._description = json.dumps(told).encode()
        self._readers: list[socket.socket] = []

    def fileno(self) -> int:
        """Return what becomes readable when somebody is at the door."""
        return self._listener.fileno()

    def answer(self) -> None:
        """Let in whoever is at the door."""
        with contextlib.suppress(OSError):
            reader, _ = self._listener.accept()
            self._readers = [known for known in self._readers if not _has_gone(known)]
            if len(self._readers) >= _MOST_READERS:
                reader.close()
                return
            self._readers.append(reader)
            reader.setblocking(False)
            socket.send_fds(reader, [self._description], [self._ring])


def _has_gone(connection: socket.socket) -> bool:
    """Whether the other end of a connection is closed; a reader never writes to it."""
    poll = select.poll()
    poll.register(connection, select.POLLIN)
    return bool(poll.poll(0))


class Tap:
    """What one process records, from now on.

    process, rate_hz: whose records they are, and its ticks a second
    topics: name by channel number; schemas: (name, ROS 2 definition) by topic
    """

    def __init__(self, path: Path) -> None:
        self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._connection.settimeout(_PATIENCE_S)
        try:
            self._connection.connect(str(path))
            raw, descriptors, _, _ = socket.recv_fds(self._connection, _DESCRIPTION_BYTES, 1)
            told = json.loads(raw)
        except (OSError, ValueError) as error:
            self._connection.close()
            raise LinkError(f"{path}: nobody records there ({error})") from None
        self._ring = Observer(descriptors[0])
        os.close(descriptors[0])
        run = told["metadata"].get("run", {})
        self.process: str = run.get("process", "")
        self.rate_hz = int(run.get("rate_hz", 0))
        self.topics: dict[int, str] = {number: name for number, name, _ in told["channels"]}
        described = {number: (name, text) for number, name, text in told["schemas"]}
        self.schemas = {name: described[schema] for _, name, schema in told["channels"]}

    @classmethod
    def join(cls, path: Path) -> Tap:
        """Join the recorder whose socket that is (drivers/zenoh/sockets.py, `records_socket`).

        Raises: LinkError when nobody records there
        """
        return cls(path)

    def read(self) -> bytes:
        """Return the MCAP Message records since the last read, whole, none when there are none.

        They are told one read late: a reader looks every few milliseconds anyway.
        """
        return self._ring.read()

    @property
    def lost(self) -> int:
        """Bytes that were missed because the last read was too long ago."""
        return self._ring.lost

    @property
    def ended(self) -> bool:
        """Whether nothing more will come: the log is closed, or its recorder has ended."""
        return self._ring.closed or _has_gone(self._connection)

    def rows(self, data: bytes) -> dict[str, NDArray[np.void]]:
        """Return records by topic as structured arrays of their fixed-size fields."""
        from drivers.recorder.rows import rows_of  # noqa: PLC0415 - numpy, where it is wanted

        return rows_of(data, self.topics)

    def close(self) -> None:
        """Leave."""
        self._connection.close()
