"""An incremental encoder as position: the Linux counter subsystem's count, by its files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from hil.errors import ConfigError, RunError

COUNTER_ROOT: Final = Path("/sys/bus/counter/devices")
_WRAP: Final = 1 << 64


class EncoderInput:
    """One count of a counter device: x = count * metres_per_count + offset.

    The kernel's count is unsigned, of 32 or 64 bits: what has run below nought is read as such.

    Raises: ConfigError when there is no such device or count
    """

    def __init__(
        self, device: str, count: int, metres_per_count: float, offset_m: float = 0.0,
        root: Path = COUNTER_ROOT,
    ) -> None:  # fmt: skip
        path = root / device / f"count{count}" / "count"
        self._metres_per_count = metres_per_count
        self._offset_m = offset_m
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise ConfigError(f"inputs.encoder: {path}: {error.strerror}") from None

    def read_m(self) -> float:
        """Return the position [m].

        Raises: RunError when the device fails
        """
        try:
            raw = int(os.pread(self._file, 32, 0))
        except (OSError, ValueError) as error:
            raise RunError(f"encoder: {error}") from None
        wrap = _WRAP if raw >= 1 << 32 else 1 << 32
        count = raw - wrap if raw >= wrap // 2 else raw
        return count * self._metres_per_count + self._offset_m

    def close(self) -> None:
        """Give the device back; a second call does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
