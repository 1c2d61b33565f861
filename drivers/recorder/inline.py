"""A recorder without a process of its own: it writes its log where the records are put.

For lockstep only, where nobody waits for the writing: a short run ends before a recorder process
would have begun.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drivers.recorder.client import CHUNK_BYTES, LogResult
from drivers.recorder.output import open_output
from drivers.recorder.process import Sink
from drivers.recorder.segments import Segments
from hil import ports
from hil.errors import RunError


class InlineRecorder(ports.Recorder):
    """Collects the records of a run into chunks, and writes each when it is full."""

    def __init__(self, path: Path, config: Mapping[str, Any]) -> None:
        self._path = path
        self._fd = open_output(path)
        self._file = Segments(self._fd, dict(config))
        self._sink = Sink(self._file, CHUNK_BYTES)
        self._pending = bytearray()

    def put(self, data: bytes, /) -> None:
        """Take the packed records of one tick as a whole."""
        self._pending += data
        if len(self._pending) >= CHUNK_BYTES:
            self._write()

    def _write(self) -> None:
        self._sink.add(bytes(self._pending))
        self._sink.flush()
        self._pending.clear()

    def close(self, timeout_s: float | None = None) -> LogResult:
        """Finish the log.

        Raises: RunError when not all of it could be written
        """
        self._write()
        if self._sink.error is None:
            self._file.add_metadata("recorder", {"end": "closed"})
        self._file.finish()
        os.close(self._fd)
        if self._sink.error is not None:
            raise RunError(f"log {self._path} ends early: {self._sink.error}")
        return LogResult(self._file.messages, 0)
