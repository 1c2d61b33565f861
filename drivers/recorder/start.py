"""Starts a recorder process, or has the service manager start one."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from drivers.recorder import unit
from hil import compiled

# The end of the writing process, and nothing else, is what ends a recorder process.
_HELD_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def start(config: Mapping[str, Any]) -> tuple[socket.socket, subprocess.Popen[bytes] | None]:
    """Start a recorder for the log that `config` describes; returns the control end."""
    address = os.environ.get(unit.VARIABLE, "")
    if address:
        return unit.hand_over(address, config), None
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        return ours, _spawn({**config, "control": theirs.fileno()})


def _spawn(config: Mapping[str, Any]) -> subprocess.Popen[bytes]:
    """Start the recorder process in a session of its own, with the descriptors in `config`."""
    described = os.memfd_create("hil-recorder-config")
    with os.fdopen(described, "w+") as standard_input:
        json.dump(config, standard_input)
        standard_input.flush()
        standard_input.seek(0)
        root = str(compiled.root())
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        # Held back until the new process, which inherits the mask, can ignore them itself.
        held = signal.pthread_sigmask(signal.SIG_BLOCK, _HELD_SIGNALS)
        try:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", "drivers.recorder.process"],
                stdin=standard_input,
                stdout=subprocess.DEVNULL,
                pass_fds=(config["out"], config["ring"], config["control"]),
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                start_new_session=True,
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
