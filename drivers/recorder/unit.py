"""A recorder that a service manager starts: it gets its descriptors over a socket.

A recorder that is a child of its loop ends with the loop's unit, whose kill takes all of its
control group. Where HIL_RECORDER_SOCKET names a listening socket, the recorder behind it is
asked instead: the service manager starts one for each connection. The connection is the control
socket, and its first message carries description, log file and ring.
"""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Mapping
from typing import Any, Final

from hil.errors import RunError

VARIABLE: Final = "HIL_RECORDER_SOCKET"
_DESCRIPTORS: Final = 3
_WITH_LIVE: Final = 4


def hand_over(address: str, config: Mapping[str, Any]) -> socket.socket:
    """Ask for a recorder; returns the control socket.

    Raises: RunError when nobody listens there
    """
    control = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    described = os.memfd_create("hil-recorder-config")
    try:
        with os.fdopen(described, "wb") as file:
            file.write(json.dumps(dict(config)).encode())
            file.flush()
            control.connect(address)
            descriptors = [file.fileno(), config["out"], config["ring"]]
            if config["live"] is not None:
                descriptors.append(config["live"])
            socket.send_fds(control, [b"record"], descriptors)
    except OSError as error:
        control.close()
        raise RunError(f"recorder at {address}: {error.strerror}") from None
    return control


def take_over(descriptor: int) -> dict[str, Any]:
    """Return the description of the log to write, with the descriptors valid in this process.

    Raises: RunError when the connection brings anything else
    """
    control = socket.socket(fileno=os.dup(descriptor))
    with control:
        _, descriptors, _, _ = socket.recv_fds(control, 64, _WITH_LIVE)
    if not _DESCRIPTORS <= len(descriptors) <= _WITH_LIVE:
        raise RunError(f"recorder: {len(descriptors)} descriptors came, {_DESCRIPTORS} are needed")
    described, out, ring, *live = descriptors
    with os.fdopen(described, "rb") as file:
        file.seek(0)
        config: dict[str, Any] = json.load(file)
    own = {"out": out, "ring": ring, "control": descriptor, "live": live[0] if live else None}
    return {**config, **own}
