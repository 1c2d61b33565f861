"""How large the ring of a recorder is: seconds of a loop, or the whole run of a deferred log."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from drivers.recorder.client import RING_BYTES
from hil.errors import ConfigError

TICK_BYTES: Final = 768
"""What a tick puts into the ring, snapshots and events included, rounded up: plant 610 bytes."""

_SECONDS: Final = 10.0
_MEMORY: Final = Path("/proc/meminfo")


def ring_bytes(rate_hz: int, duration_s: float) -> int:
    """Room for ten seconds of a loop, or its run, as far as an eighth of the free memory goes."""
    size = _power_of_two(TICK_BYTES * rate_hz * min(_SECONDS, duration_s))
    while size > RING_BYTES and size > available_bytes() // 8:
        size //= 2
    return size


def deferred_ring_bytes(rate_hz: int, duration_s: float) -> int:
    """Room for a whole run.

    Raises: ConfigError when two of them, one of each process, find no room in the memory
    """
    size, free = _power_of_two(TICK_BYTES * rate_hz * duration_s), available_bytes()
    if 2 * size > free:
        raise ConfigError(
            f"log.defer: both logs of {duration_s:g} s at {rate_hz} Hz take 2 x {size >> 20} MiB of"
            f" memory, {free >> 20} MiB are available"
        )
    return size


def _power_of_two(size: float) -> int:
    least = max(round(size), RING_BYTES)
    return 1 << (least - 1).bit_length()


def available_bytes() -> int:
    """Memory that can be had without swapping; 0 where the system does not say."""
    try:
        found = re.search(r"MemAvailable:\s+(\d+) kB", _MEMORY.read_text(encoding="ascii"))
    except OSError:
        found = None
    return int(found[1]) << 10 if found else 0
