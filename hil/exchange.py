"""Waiting for a batch that must come: for as long as the peer is there, and no longer."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from hil.ports import Link

_SLICE_NS: Final = 50_000_000


def await_batch(link: Link, patience_ns: i64) -> bytes | None:
    """Return the next batch; None when the peer is gone or its time is up.

    Parameters: patience_ns : the longest wait [ns]
    """
    left_ns = patience_ns
    while left_ns > 0:
        batch = link.wait(min(_SLICE_NS, left_ns))
        if batch is not None:
            return batch
        if not link.peer_alive():
            return link.receive()
        left_ns -= _SLICE_NS
    return None
