"""The status of both processes, as they publish it, for the live view."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

from drivers.links import open_operator
from drivers.zenoh.channels import ZenohOperator
from hil.config.resolved import Resolved

Status = Mapping[str, Any]


@asynccontextmanager
async def watch_status(
    scenario: Resolved, on_status: Callable[[Status], None]
) -> AsyncIterator[None]:
    """Hand each status that a process publishes to `on_status` while the body runs.

    With the memory link there is no key to follow: its process prints its status.

    Raises: ConfigError when the endpoints are refused, LinkError when the session does not open
    """
    if scenario.link.kind == "memory":
        yield
        return
    operator = open_operator(scenario.link, scenario.loop, "hil run")
    following = asyncio.create_task(_follow(operator, on_status))
    try:
        yield
    finally:
        following.cancel()
        await asyncio.to_thread(operator.close)


async def _follow(operator: ZenohOperator, on_status: Callable[[Status], None]) -> None:
    async for process, status in operator.statuses():
        on_status({"process": process, **status})
