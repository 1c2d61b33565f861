"""Ports of this machine alone, at which tools reach a running engine."""

from __future__ import annotations

import socket
from typing import Final

from hil.errors import ConfigError

HOST: Final = "127.0.0.1"


def bound(port: int, kind: socket.SocketKind = socket.SOCK_STREAM) -> socket.socket:
    """Return a socket at a port, a stream's one listening; port 0 takes any that is free.

    Raises: ConfigError when it is taken
    """
    made = socket.socket(socket.AF_INET, kind)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
        if kind == socket.SOCK_STREAM:
            made.listen()
    except OSError as error:
        made.close()
        raise ConfigError(
            f"--port {port}: {error.strerror}; accepted is one that is free"
        ) from None
    return made
