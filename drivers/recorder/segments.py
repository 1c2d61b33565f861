"""The files of one log: the one being written, and those before it that were finished.

A segment is finished and renamed when it has reached its size or its time, and the next one takes
the log's name in the same instant. Each is a whole log with all that a replay needs.
"""

from __future__ import annotations

import base64
import contextlib
import fcntl
import os
from pathlib import Path
from typing import Any

from mcap.records import Channel, Schema

from drivers.recorder.index import MessageIndex, index_messages
from drivers.recorder.mcap_file import McapFile
from hil.log.segments import segment_path, segments_before


class Segments:
    """What a recorder process writes to.

    Methods raise OSError when bytes could not be written; what was written before stays whole.
    """

    def __init__(self, fd: int, config: dict[str, Any]) -> None:
        self._config = config
        rotation = config.get("rotation") or {}
        self._path = Path(rotation["path"]) if rotation else None
        self._most_bytes: int | None = rotation.get("bytes")
        self._most_ns: int | None = rotation.get("ns")
        self._retain_bytes: int | None = rotation.get("retain_bytes")
        self._number = config.get("segment") or 1
        self._fd = fd
        self._file = self._begin(fd, self._number)
        self._start_ns: int | None = None
        self._finished_messages = 0

    @property
    def messages(self) -> int:
        """Messages written so far, in all segments."""
        return self._finished_messages + self._file.messages

    def add_chunk(self, data: bytes, index: MessageIndex) -> None:
        """Write one chunk, and begin another segment when this one is full."""
        self._file.add_chunk(data, index)
        if self._start_ns is None:
            self._start_ns = index.first_ns
        if self._path is not None and self._is_full(index.last_t_ns):
            self._rotate(self._path)

    def add_last(self, data: bytes) -> None:
        """Write a small last chunk into what was kept free for the end."""
        self._file.add_chunk(data, index_messages(data), reserve=False)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Write one Metadata record into the segment that is being written."""
        self._file.add_metadata(name, values)

    def finish(self) -> None:
        """Finish the segment that is being written."""
        self._file.finish()

    def _is_full(self, t_ns: int) -> bool:
        if self._most_bytes is not None and self._file.size >= self._most_bytes:
            return True
        return self._most_ns is not None and t_ns - (self._start_ns or 0) >= self._most_ns

    def _begin(self, fd: int, number: int) -> McapFile:
        """Write the head of a file: topics, metadata and attachments, all of them in each."""
        config = self._config
        schemas = [
            Schema(id=schema, name=name, encoding="ros2msg", data=text.encode())
            for schema, name, text in config["schemas"]
        ]
        channels = [
            Channel(id=channel, topic=topic, message_encoding="cdr", schema_id=schema, metadata={})
            for channel, topic, schema in config["channels"]
        ]
        file = McapFile(fd, schemas, channels)
        for name, values in config["metadata"].items():
            file.add_metadata(name, values)
        if self._path is not None or number > 1:
            file.add_metadata("segment", {"number": str(number)})
        for name, media_type, content in config["attachments"]:
            file.add_attachment(name, media_type, base64.b64decode(content))
        return file

    def _rotate(self, path: Path) -> None:
        """Finish this segment under its number; the next one takes the name of the log."""
        following = path.with_name(f"{path.name}.next")
        try:
            fd = os.open(following, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
            fcntl.flock(fd, fcntl.LOCK_EX)
            file = self._begin(fd, self._number + 1)
        except OSError:  # no room for another file: this one goes on for as long as it can
            following.unlink(missing_ok=True)
            return
        self._file.add_metadata("recorder", {"end": "goes on in the next segment"})
        self._file.finish()
        self._finished_messages += self._file.messages
        os.link(path, segment_path(path, self._number))
        following.replace(path)
        os.close(self._fd)
        self._number += 1
        self._fd, self._file, self._start_ns = fd, file, None
        if self._retain_bytes is not None:
            _forget_oldest(path, self._retain_bytes)


def _forget_oldest(path: Path, most_bytes: int) -> None:
    """Delete finished segments, the oldest first, while all together are too large."""
    segments = segments_before(path)
    total = sum(segment.stat().st_size for segment in segments)
    for segment in segments:
        if total <= most_bytes:
            return
        total -= segment.stat().st_size
        with contextlib.suppress(FileNotFoundError):
            segment.unlink()
