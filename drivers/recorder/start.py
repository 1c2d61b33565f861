"""Starting a recorder process on an open file, with a ring to it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from drivers.recorder import ring, unit
from hil import compiled
from hil.log.records import Topic

# The end of the writing process, and nothing else, is what ends a recorder process.
_HELD_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def describe(topics: Sequence[Topic]) -> dict[str, Any]:
    """Return schemas and channels of the log; topics of one record class share a schema."""
    numbers: dict[str, int] = {}
    schemas = []
    for topic in topics:
        if topic.schema_name not in numbers:
            numbers[topic.schema_name] = len(numbers) + 1
            schemas.append((numbers[topic.schema_name], topic.schema_name, topic.definition))
    channels = [(topic.channel_id, topic.name, numbers[topic.schema_name]) for topic in topics]
    return {"schemas": schemas, "channels": channels}


def joined(
    out: int, config: Mapping[str, Any], segment: int | None = None,
    producer: ring.Producer | None = None, live: socket.socket | None = None,
) -> tuple[ring.Producer, socket.socket, subprocess.Popen[bytes] | None]:  # fmt: skip
    """Start a recorder process on an open file; returns the ring to it and what belongs to it.

    Parameters: producer : of a ring whose recorder was lost, with what that one has not written;
        live : where readers of the ring are let in
    """
    ring_fd = ring.create(config["ring_bytes"]) if producer is None else os.dup(producer.fd)
    try:
        if producer is not None:
            producer.rewind()
        descriptors = {"out": out, "ring": ring_fd, "live": None if live is None else live.fileno()}
        control, process = _start({**config, **descriptors, "segment": segment})
        return producer or ring.Producer(ring_fd), control, process
    finally:
        os.close(ring_fd)
        os.close(out)


def _start(config: Mapping[str, Any]) -> tuple[socket.socket, subprocess.Popen[bytes] | None]:
    """Start a recorder process, or have the service manager start one; returns the control end."""
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
        handed = (config["out"], config["ring"], config["control"], config["live"])
        try:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", "drivers.recorder.process"],
                stdin=standard_input,
                stdout=subprocess.DEVNULL,
                pass_fds=[descriptor for descriptor in handed if descriptor is not None],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                start_new_session=True,
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
