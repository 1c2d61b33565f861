"""A few facts that outlive the kill of a process: a small file, mapped into memory.

Keeping them is a store to memory, not a system call, so a loop may do it. On a service's runtime
directory, which is memory too, they last as long as the service is not stopped on purpose.
"""

from __future__ import annotations

import json
import mmap
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from hil.errors import ConfigError

SIZE: Final = 512


class Keepsake:
    """One JSON object in a file of fixed size."""

    def __init__(self, path: Path) -> None:
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise ConfigError(f"{path}: {error.strerror}") from None
        try:
            os.ftruncate(descriptor, SIZE)
            self._map = mmap.mmap(descriptor, SIZE)
        finally:
            os.close(descriptor)
        self._newest: Mapping[str, Any] = {}

    def read(self) -> dict[str, Any]:
        """Return what was kept; nothing when there is none, or when a kill cut it in two."""
        try:
            found = json.loads(self._map[:].rstrip(b"\0 "))
        except ValueError:
            return {}
        return found if isinstance(found, dict) else {}

    def keep(self, facts: Mapping[str, Any]) -> None:
        """Replace what is kept, if it has changed."""
        if facts == self._newest:
            return
        self._newest = dict(facts)
        self._map[:] = json.dumps(self._newest).encode().ljust(SIZE)

    def close(self) -> None:
        """Give the memory back; the file stays."""
        self._map.close()
