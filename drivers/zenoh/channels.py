"""Commands to the processes and their status over Zenoh: JSON on two keys, polled like the link."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections.abc import AsyncIterator, Mapping
from typing import Any, Final

import zenoh

from drivers.channels import (
    MAX_WAITING,
    clip_command,
    origin_text,
)
from drivers.zenoh.link import is_heard
from drivers.zenoh.node import ZenohNode, give_back
from hil.errors import LinkError
from hil.wire import commands, status

_POLL_S: Final = 0.02  # of the live view; a person sees no difference below it


class ZenohCommands:
    """A process's side of the command key."""

    def __init__(self, node: ZenohNode) -> None:
        self._subscriber = node.session.declare_subscriber(
            node.key("command"), zenoh.handlers.RingChannel(MAX_WAITING)
        )
        self._closed = False

    def poll(self) -> tuple[str, bytes] | None:
        """Return (origin, raw command) of the oldest command not yet taken, or None.

        The origin is what the sender calls itself and the identity of its session.
        """
        if self._closed or (sample := self._subscriber.handler.try_recv()) is None:
            return None
        named = b"" if sample.attachment is None else sample.attachment.to_bytes()
        source = sample.source_info
        session = "unknown session" if source is None else f"zenoh {source.source_id.zid}"
        return f"{origin_text(named)} ({session})", clip_command(sample.payload.to_bytes())

    def close(self) -> None:
        """Undeclare the key; a second call does nothing."""
        if not self._closed:
            self._closed = True
            give_back(self._subscriber.undeclare)


class ZenohStatus:
    """A process's side of its status key; as often as it tells, it looks who is there."""

    def __init__(self, node: ZenohNode) -> None:
        self._node = node
        self._publisher = node.session.declare_publisher(
            node.key(f"status/{node.role}"),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
            encoding=zenoh.Encoding.APPLICATION_JSON,
        )
        self._closed = False

    def publish(self, told: Mapping[str, object], /) -> None:
        """Publish; dropped when nobody keeps up or the session is gone."""
        if not self._closed:
            with contextlib.suppress(zenoh.ZError):
                self._node.attend()
                self._publisher.put(status.write(told))

    def close(self) -> None:
        """Undeclare the key; a second call does nothing."""
        if not self._closed:
            self._closed = True
            give_back(self._publisher.undeclare)


class ZenohOperator:
    """The other side of both keys: sends commands, follows what the processes say of themselves."""

    def __init__(self, node: ZenohNode, name: str) -> None:
        self._node = node
        self._origin = f"{name}, process {os.getpid()}"
        self._sent = 0
        self._commands = node.session.declare_publisher(
            node.key("command"),
            congestion_control=zenoh.CongestionControl.BLOCK,
            encoding=zenoh.Encoding.APPLICATION_JSON,
            express=True,
        )
        self._statuses = node.session.declare_subscriber(
            node.key("status/*"), zenoh.handlers.RingChannel(64)
        )

    def alive(self) -> set[str]:
        """Return the processes that take part by now."""
        return self._node.alive()

    def send_command(self, command: Mapping[str, object]) -> None:
        """Send one command to every process of the engine.

        Raises: LinkError when none listens
        """
        if not is_heard(self._commands):
            raise LinkError(f"no process of engine {self._node.config.engine!r} takes commands")
        source = zenoh.SourceInfo(self._commands.id, self._sent)
        self._sent += 1
        raw = commands.encode(command)
        try:
            self._commands.put(raw, attachment=self._origin, source_info=source)
        except zenoh.ZError as error:
            raise LinkError(f"zenoh: a command was not sent: {error}") from None

    def poll_status(self) -> tuple[str, dict[str, Any]] | None:
        """Return (process, status) of the oldest status not yet taken, or None."""
        while (sample := self._statuses.handler.try_recv()) is not None:
            process = str(sample.key_expr).rsplit("/", 1)[1]
            told = status.read(process, sample.payload.to_bytes())
            if told is not None:  # not one of ours; no reason to stop the live view
                return process, told
        return None

    async def statuses(self) -> AsyncIterator[tuple[str, dict[str, Any]]]:
        """Yield (process, status) as they come, for ever; cancel to stop."""
        while True:
            while (told := self.poll_status()) is not None:
                yield told
            await asyncio.sleep(_POLL_S)

    async def wait_for(self, processes: set[str], timeout_s: float) -> None:
        """Return when these processes take part and take commands.

        Raises: LinkError naming those that do not within the time
        """
        end_s = time.monotonic() + timeout_s
        while not (processes <= self.alive() and is_heard(self._commands)):
            if time.monotonic() > end_s:
                missing = " and no ".join(sorted(processes - self.alive())) or "command listener"
                raise LinkError(f"no {missing} after {timeout_s:g} s")
            await asyncio.sleep(_POLL_S)

    def close(self) -> None:
        """Leave; a second call does nothing."""
        give_back(self._statuses.undeclare, self._commands.undeclare)
        self._node.close()
