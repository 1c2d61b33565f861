"""The status of both processes, as they publish it, for the live view."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from bench.children import Status
from hil.config.process import LinkConfig


@asynccontextmanager
async def watch_status(config: LinkConfig, on_status: Callable[[Status], None]) -> AsyncIterator[None]:
    """Hand each status that either process publishes to `on_status` while the body runs."""
    yield
