"""What a service tells its manager: ready, alive, how it is. Silent where nobody asked.

The protocol is sd_notify(3): datagrams of KEY=VALUE lines to the socket in NOTIFY_SOCKET.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping


class Notifier:
    """One service's line to its manager; a send never blocks and costs one system call."""

    __slots__ = ("_socket", "watchdog_ns")

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self.watchdog_ns = _watchdog_ns(environment)
        self._socket = _connected(environment.get("NOTIFY_SOCKET", ""))

    def tell(self, *lines: str) -> None:
        """Send the lines as one message; what the manager has no room for now is left out."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.send("\n".join(lines).encode())

    def ready(self, status: str) -> None:
        """Start-up is complete."""
        self.tell("READY=1", f"STATUS={status}")

    def waiting(self, status: str, at_most_s: float) -> None:
        """Start-up goes on and may take so much longer from now."""
        self.tell(f"EXTEND_TIMEOUT_USEC={round((at_most_s + _MARGIN_S) * 1e6)}", f"STATUS={status}")

    def feed(self) -> None:
        """The loop is alive. Call it from the loop and from nowhere else."""
        self.tell("WATCHDOG=1")

    def status(self, text: str) -> None:
        """Say how the service is, in one line."""
        self.tell(f"STATUS={text}")

    def stopping(self) -> None:
        """The end was asked for and has begun."""
        self.tell("STOPPING=1", "STATUS=finishing the log")

    def close(self) -> None:
        """Give the socket back."""
        if self._socket is not None:
            self._socket.close()


_MARGIN_S = 30.0


def _watchdog_ns(environment: Mapping[str, str]) -> int:
    """Interval after which an unfed service is killed [ns]; 0: nobody watches this process."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return 0
    microseconds = environment.get("WATCHDOG_USEC", "0")
    return int(microseconds) * 1000 if microseconds.isdecimal() else 0


def _connected(address: str) -> socket.socket | None:
    """Return a socket to the manager; "@" stands for the abstract name space."""
    if not address:
        return None
    name = f"\0{address[1:]}" if address.startswith("@") else address
    channel = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
    try:
        channel.connect(name)
    except OSError:
        channel.close()
        return None
    return channel
