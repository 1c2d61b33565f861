"""`hil repair`: a new file from every whole chunk of a damaged one, proved by reading it back."""

from __future__ import annotations

import os
import zlib
from pathlib import Path
from typing import NamedTuple

from drivers.recorder.index import index_messages
from drivers.recorder.mcap_file import McapFile
from hil import log as logs
from hil.errors import LogError
from hil.files import Output
from hil.log.repair import Salvage, survey, whole_messages
from hil.log.verify import verify


class Repaired(NamedTuple):
    """What a repair saved, and what it could not."""

    out: Path
    chunks: int
    messages: int
    first_ns: int
    last_ns: int
    lost: tuple[str, ...]


def default_out(path: Path) -> Path:
    """Return LOG with .repaired.mcap."""
    return path.with_suffix(".repaired.mcap")


def repair(path: Path, out: Path | None = None, *, force: bool = False) -> Repaired:
    """Write what can be saved from a log to a new file.

    Raises: LogError when nothing can be saved, or the new file does not read back as it was
        written; ConfigError when it cannot be written
    """
    file = Output("--out", out or default_out(path), force, (path,))
    target = file.path
    found = survey(path)
    if found.lost and not found.whole:
        raise LogError(f"{path}: nothing can be saved: {found.lost[0]}; no whole chunk was found")
    file.check()
    with file.writing() as beside:
        fd = os.open(beside, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            written = _write(path, fd, found)
        finally:
            os.close(fd)
        first_ns, last_ns = _prove(beside, target, written)
    return Repaired(target, len(found.whole), written[0], first_ns, last_ns, tuple(found.lost))


def _write(path: Path, fd: int, found: Salvage) -> tuple[int, int]:
    """Write the new file; return its messages, and the checksum of all their bytes."""
    file = McapFile(fd, [*found.schemas.values()], [*found.channels.values()], found.header)
    for name, values in found.metadata.items():
        file.add_metadata(name, values)
    notes = {str(number): line for number, line in enumerate(found.lost, 1)}
    file.add_metadata("repaired", {"from": path.name, **notes})
    for attachment in found.attachments:
        file.add_attachment(*attachment)
    crc = 0
    for data in whole_messages(path, found):
        crc = zlib.crc32(data, crc)
        if data:
            file.add_chunk(data, index_messages(data))
    file.finish()
    return file.messages, crc


def _prove(made: Path, target: Path, written: tuple[int, int]) -> tuple[int, int]:
    """Read the new file back, every byte of it; return log time of its first and last message.

    Raises: LogError when it is not what was written
    """
    try:
        verify(made)
        with logs.open(made) as log:
            crc = 0
            for data in log.raw():
                crc = zlib.crc32(data, crc)
            messages = sum(info.messages for info in log.topics.values())
            if (messages, crc) == written:
                return log.start_ns, log.end_ns
            reason = "other messages than were written"
    except LogError as error:
        reason = str(error).removeprefix(f"{made}: ")
    raise LogError(f"{target}: does not read back as it was written, and is not kept: {reason}")
