"""A byte ring in shared memory between one producing and one consuming process, and who looks on.

The memory is an anonymous file (memfd) that both sides map; whoever holds its descriptor may
join, and it vanishes with the last holder. The first page holds counters, the rest the bytes.
`head` and `tail` count all bytes ever read and written, so tail - head is what waits.

Each counter has one writer and is one aligned 8-byte store. A put becomes visible as a whole by
the store of `tail`, after its bytes: a producer that is killed at any instant leaves complete
puts only. Processors that reorder stores (ARM) are met on the reading side, see `Consumer.read`.
"""

from __future__ import annotations

import mmap
import os
from typing import NamedTuple

from mypy_extensions import i64

PAGE = 4096
_TAIL, _HEAD, _DROPPED, _CLOSED = 0, 8, 16, 24  # places of 8 bytes; one cache line each
_DROPPED_BYTES, _DROPPED_FROM, _DROPPED_TO = 17, 18, 19
_WRITTEN = 32  # up to here everything is in a file, to the end of a record


class Loss(NamedTuple):
    """Puts that found no room: how many, how many bytes, the first and the last by their time."""

    puts: int
    size: int
    first_ns: int
    last_ns: int


def create(capacity: int) -> int:
    """Return the descriptor of a new ring of `capacity` bytes.

    Raises: ValueError when the capacity is no power of two of at least one page
    """
    if capacity < PAGE or capacity & (capacity - 1):
        raise ValueError(f"ring capacity {capacity}: a power of two from {PAGE} on is needed")
    fd = os.memfd_create("hil-ring")
    os.ftruncate(fd, PAGE + capacity)
    return fd


def _map(fd: int, prot: int = mmap.PROT_READ | mmap.PROT_WRITE) -> tuple[memoryview, memoryview]:
    """Return the counters and the bytes of a ring, with every page already present."""
    flags = mmap.MAP_SHARED | mmap.MAP_POPULATE
    shared = memoryview(mmap.mmap(fd, os.fstat(fd).st_size, flags=flags, prot=prot))
    return shared[:PAGE].cast("Q"), shared[PAGE:]


class Producer:
    """The writing end: `put` never blocks and never makes a system call."""

    __slots__ = ("_bytes", "_capacity", "_counters", "_limit", "_mask", "_tail", "fd")

    def __init__(self, fd: int) -> None:
        self.fd = os.dup(fd)
        self._counters, self._bytes = _map(fd)
        self._capacity: i64 = len(self._bytes)
        self._mask: i64 = self._capacity - 1
        self._tail: i64 = self._counters[_TAIL]
        self._limit: i64 = self._counters[_HEAD] + self._capacity

    def put(self, data: bytes) -> bool:
        """Append the bytes as a whole; False when they do not fit."""
        tail = self._tail
        size: i64 = len(data)
        end = tail + size
        if end > self._limit:
            # Only a ring that looks full is worth a look at what the other side wrote.
            head: i64 = self._counters[_HEAD]
            self._limit = head + self._capacity
            if end > self._limit:
                return False
        start = tail & self._mask
        stop = start + size
        if stop <= self._capacity:
            self._bytes[start:stop] = data
        else:
            cut = self._capacity - start
            self._bytes[start:] = data[:cut]
            self._bytes[: stop - self._capacity] = data[cut:]
        self._tail = self._counters[_TAIL] = end
        return True

    @property
    def capacity(self) -> int:
        """Bytes that the ring holds."""
        return self._capacity

    @property
    def dropped(self) -> int:
        """Puts that were given up, as told by `count_dropped`."""
        return self._counters[_DROPPED]

    def count_dropped(self, size: int = 0, t_ns: int = 0) -> None:
        """Tell the other side of one put that was given up: its bytes and its time [ns]."""
        counters = self._counters
        if counters[_DROPPED] == 0:
            counters[_DROPPED_FROM] = t_ns
        counters[_DROPPED_TO] = t_ns
        counters[_DROPPED_BYTES] += size
        counters[_DROPPED] += 1

    @property
    def waiting(self) -> int:
        """Bytes that were put and not yet read."""
        return self._tail - self._counters[_HEAD]

    def rewind(self) -> None:
        """Let another consumer begin with what the one before has read and not written.

        If that has been overwritten by now, with what is put next.
        """
        written: i64 = self._counters[_WRITTEN]
        head = written if self._tail - written <= self._capacity else self._tail
        self._counters[_HEAD] = self._counters[_WRITTEN] = head
        self._limit = head + self._capacity

    def close(self) -> None:
        """Tell the other side that nothing more will come, and on purpose."""
        self._counters[_CLOSED] = 1
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1


class Consumer:
    """The reading end.

    dropped_before: puts given up before the bytes that come next; most: bytes that ever waited
    """

    def __init__(self, fd: int) -> None:
        self._counters, self._bytes = _map(fd)
        self.capacity = len(self._bytes)
        self._mask = self.capacity - 1
        self._head = self._counters[_HEAD]
        self._seen = self._head
        self._seen_dropped = 0
        self.dropped_before = 0
        self.most = 0

    def read(self, at_most: int, *, final: bool = False) -> bytes:
        """Return and free the bytes that were complete at the call before this one.

        The tail is acted on one call late because a processor with weak ordering may show it
        before the bytes; a poll later, microseconds at least, they are there. `final` takes
        everything: the producer has ended, and the kernel has ordered its last stores.
        """
        visible, dropped = self._seen, self._seen_dropped
        self._seen, self._seen_dropped = self._counters[_TAIL], self._counters[_DROPPED]
        if final:
            visible, dropped = self._seen, self._seen_dropped
        head = self._head
        self.most = max(self.most, self._seen - head)
        count = min(visible - head, at_most)
        if head + count == visible:
            self.dropped_before = dropped
        if not count:
            return b""
        start = head & self._mask
        data = bytes(self._bytes[start : start + count])
        if len(data) < count:
            data += self._bytes[: count - len(data)]
        self._head = self._counters[_HEAD] = head + count
        return data

    def note_written(self, pending: int) -> None:
        """Take note that all but the last bytes that were read are in a file."""
        self._counters[_WRITTEN] = self._head - pending

    @property
    def waiting(self) -> int:
        """Bytes that were put and not yet read."""
        return self._counters[_TAIL] - self._head

    @property
    def dropped(self) -> int:
        """Puts that the producer gave up."""
        return self._counters[_DROPPED]

    @property
    def loss(self) -> Loss:
        """Those puts and what was in them."""
        counters = self._counters
        return Loss(counters[_DROPPED], counters[_DROPPED_BYTES], counters[_DROPPED_FROM],
                    counters[_DROPPED_TO])  # fmt: skip

    @property
    def closed(self) -> bool:
        """Whether the producer ended on purpose."""
        return bool(self._counters[_CLOSED])


class Observer:
    """A further reading end that leaves no trace in the ring: nobody waits for it.

    What it sees stays in the ring until the producer has gone round once, whoever has consumed it.
    A reader that falls back by half of that loses what it has missed and goes on with the newest.

    lost: bytes that it has missed
    """

    def __init__(self, fd: int) -> None:
        self._counters, self._bytes = _map(fd, mmap.PROT_READ)
        self._capacity: i64 = len(self._bytes)
        self._head: i64 = self._counters[_TAIL]
        self._seen: i64 = self._head
        self.lost: i64 = 0

    def read(self) -> bytes:
        """Return the puts that were complete at the call before this one, see `Consumer.read`."""
        visible, self._seen = self._seen, self._counters[_TAIL]
        count = visible - self._head
        if not count:
            return b""
        data = b"" if count > self._capacity // 2 else self._copy(count)
        # A put under way writes ahead of the tail: half of the ring is more than any has.
        if self._counters[_TAIL] - self._head > self._capacity // 2:
            data = b""
        if not data:
            self.lost += count
        self._head = visible
        return data

    def _copy(self, count: i64) -> bytes:
        start = self._head & (self._capacity - 1)
        stop = start + count
        if stop <= self._capacity:
            return bytes(self._bytes[start:stop])
        return bytes(self._bytes[start:]) + bytes(self._bytes[: stop - self._capacity])

    @property
    def closed(self) -> bool:
        """Whether the producer ended on purpose."""
        return bool(self._counters[_CLOSED])
