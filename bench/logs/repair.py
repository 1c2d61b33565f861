"""`hil repair`: a new file from every whole chunk of a damaged one, proved by reading it back."""

from __future__ import annotations

import os
import zlib
from pathlib import Path
from typing import NamedTuple

from bench.run import directory
from drivers.recorder.index import index_messages
from drivers.recorder.mcap_file import McapFile
from hil import log as logs
from hil.errors import ConfigError, LogError
from hil.log.repair import Salvage, survey, whole_chunks


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


def repair(path: Path, out: Path | None = None) -> Repaired:
    """Write what can be saved from a log to a new file.

    Raises: LogError when nothing can be saved, or the new file does not read back as it was
        written; ConfigError when it cannot be written
    """
    target = out or default_out(path)
    if not target.exists():
        directory.check_file("--out", target)
    found = survey(path)
    try:
        fd = os.open(target, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
    except FileExistsError:
        raise ConfigError(f"{target}: exists already; give another name with -o") from None
    except OSError as error:
        raise ConfigError(f"{target}: {error.strerror}") from None
    try:
        written = _write(path, fd, found)
    except OSError as error:
        target.unlink(missing_ok=True)
        raise ConfigError(f"{target}: {error.strerror}") from None
    finally:
        os.close(fd)
    return _proved(target, found, written)


def _write(path: Path, fd: int, found: Salvage) -> tuple[int, int]:
    """Write the new file; return its messages, and the checksum of all their bytes."""
    file = McapFile(fd, list(found.schemas.values()), list(found.channels.values()))
    for name, values in found.metadata.items():
        file.add_metadata(name, values)
    notes = {str(number): line for number, line in enumerate(found.lost, 1)}
    file.add_metadata("repaired", {"from": path.name, **notes})
    for attachment in found.attachments:
        file.add_attachment(*attachment)
    crc = 0
    for data in whole_chunks(path, found):
        crc = zlib.crc32(data, crc)
        if data:
            file.add_chunk(data, index_messages(data))
    file.finish()
    return file.messages, crc


def _proved(target: Path, found: Salvage, written: tuple[int, int]) -> Repaired:
    """Read the new file back, every byte of it.

    Raises: LogError when it is not what was written
    """
    with logs.open(target) as log:
        crc = 0
        for data in log.raw():
            crc = zlib.crc32(data, crc)
        messages = sum(info.messages for info in log.topics.values())
        if (messages, crc) != written:
            raise LogError(f"{target}: does not read back as it was written")
        return Repaired(
            target, len(found.whole), messages, log.start_ns, log.end_ns, tuple(found.lost)
        )
