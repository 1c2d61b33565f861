"""How a link with a descriptor waits for its peer: asleep in the kernel until frames come.

A poll that sleeps and yields costs a core a good part of each period; a kernel that preempts for
real time wakes a sleeper within microseconds.
"""

from __future__ import annotations

import select
import time
from typing import Final

from drivers.polling import Take

_NS: Final = 1e-9


class Blocking:
    """Waits on a descriptor.

    Parameters: take : the link's own look for a batch; quiet_ns : how long after frames that make
        no batch it is worth to look again [ns]
    """

    __slots__ = ("_descriptors", "_quiet_ns", "_take")

    def __init__(self, take: Take, descriptor: int, quiet_ns: int) -> None:
        self._take = take
        self._descriptors = (descriptor,)
        self._quiet_ns = quiet_ns

    def wait(self, timeout_ns: int) -> bytes | None:
        """Return the next batch, or None after the timeout [ns]."""
        now_ns = time.monotonic_ns()
        deadline_ns = now_ns + timeout_ns
        slice_ns = timeout_ns
        while now_ns < deadline_ns:
            select.select(self._descriptors, (), (), min(deadline_ns - now_ns, slice_ns) * _NS)
            batch = self._take()
            if batch is not None:
                return batch
            slice_ns = self._quiet_ns
            now_ns = time.monotonic_ns()
        return None
