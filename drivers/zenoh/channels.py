"""Commands to the processes and their status over Zenoh: JSON on two keys, polled like the link."""

from __future__ import annotations

import contextlib
import os
import time
from collections import deque
from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import zenoh

from drivers.channels import (
    STOP,
    clip_command,
    is_stop,
    origin_text,
)
from drivers.zenoh.node import ZenohNode, give_back, is_heard
from hil.errors import LinkError
from hil.ports import CommandSource, StatusSink
from hil.wire import answers, commands, status
from hil.wire.answers import MAX_WAITING, CommandAnswer

_STOPS: Final = 8
_AT_ONCE: Final = 16
"""Commands that one look takes in from a key at the most; the loop waits for them."""

_POLL_S: Final = 0.02  # of the live view; a person sees no difference below it


class ZenohCommands(CommandSource):
    """A process's side of the command keys: what is put there is taken, what is asked is answered.

    A stop has a key of its own, on which whatever comes is a stop: no queue is before it.
    """

    def __init__(self, node: ZenohNode) -> None:
        self._node = node
        self._command, self._stop = node.key("command"), node.key("stop")
        obeys = node.role == "controller"
        self._stops = self._inlets(self._stop, _STOPS) if obeys else ()
        self._inlets_of_all = self._inlets(self._command, MAX_WAITING)
        self._waiting: deque[_Received] = deque()
        self._asked: zenoh.Query | None = None
        self._refused = 0
        self._closed = False

    def _inlets(self, key: str, room: int) -> tuple[Any, ...]:
        """What is put on a key and what is asked on it; of a flood the newest."""
        session, ring = self._node.session, zenoh.handlers.RingChannel
        return (
            session.declare_subscriber(key, ring(room)),
            session.declare_queryable(key, ring(room)),
        )

    def poll(self) -> tuple[str, bytes] | None:
        """Return (origin, raw command) of a stop, or of the oldest command not yet taken, or None.

        The origin is what the sender calls itself and the identity of its session.
        """
        if self._closed:
            return None
        self._settle(None)
        for inlet in self._stops:
            if (sample := inlet.handler.try_recv()) is not None:
                received = _received(sample)
                self._settle(received.query)
                return received.origin, STOP
        stop = self._fill()
        if stop is None and not self._waiting:
            return None
        received = stop or self._waiting.popleft()
        self._settle(received.query)
        return received.origin, received.raw

    def _settle(self, query: zenoh.Query | None) -> None:
        """The one who asked before waits no longer; from now on another one does, or nobody."""
        if self._asked is not None:
            give_back(self._asked.drop)
        self._asked = query

    def _fill(self) -> _Received | None:
        """Take in some of what has come; returns a stop if one is among it."""
        for inlet in self._inlets_of_all:
            for _ in range(_AT_ONCE):
                if (sample := inlet.handler.try_recv()) is None:
                    break
                received = _received(sample)
                if is_stop(received.raw):
                    return received
                if len(self._waiting) < MAX_WAITING:
                    self._waiting.append(received)
                else:
                    self._refuse(received)
        return None

    def _refuse(self, received: _Received) -> None:
        """Answer at once what there is no room for, and say so as an event now and then."""
        self._refused += 1
        text = f"{MAX_WAITING} commands wait already; accepted is one every ten ticks"
        if received.query is not None:
            told = CommandAnswer(self._node.role, False, 0, text)
            self._reply(received.query, self._command, told)
        if self._refused & (self._refused - 1) == 0:  # the first, the second, the fourth ...
            last = f"the last from {received.origin}: {text}"
            self._node.note("command-flood", f"{self._refused} commands were refused, {last}")

    def answer(
        self, is_taken: bool, tick: int, text: str, values: Mapping[str, Any] | None = None, /
    ) -> None:
        """Tell who sent the command that was polled last what has become of it."""
        query, self._asked = self._asked, None
        if query is not None:
            told = CommandAnswer(self._node.role, is_taken, tick, text, values or {})
            self._reply(query, str(query.key_expr), told)

    def _reply(self, query: zenoh.Query, key: str, told: CommandAnswer) -> None:
        with contextlib.suppress(zenoh.ZError):
            query.reply(key, answers.write(told))
        give_back(query.drop)

    def close(self) -> None:
        """Undeclare the keys; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self._settle(None)
            give_back(*(inlet.undeclare for inlet in (*self._stops, *self._inlets_of_all)))


class _Received(NamedTuple):
    """A command as it came, with who waits for its answer."""

    origin: str
    raw: bytes
    query: zenoh.Query | None


def _received(sample: zenoh.Sample | zenoh.Query) -> _Received:
    """Read what was put or asked, bounded before it is read."""
    named = b"" if sample.attachment is None else sample.attachment.to_bytes()
    source = sample.source_info
    session = "unknown session" if source is None else f"zenoh {source.source_id.zid}"
    raw = b"" if sample.payload is None else clip_command(sample.payload.to_bytes())
    query = sample if isinstance(sample, zenoh.Query) else None
    return _Received(f"{origin_text(named)} ({session})", raw, query)


class ZenohStatus(StatusSink):
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

    def ask(self, command: Mapping[str, object], to: str, timeout_s: float) -> CommandAnswer:
        """Send one command and return what its addressee says.

        Raises: LinkError when it says nothing within the time, or takes none of this operator
        """
        return self.ask_all(command, (to,), timeout_s)[0]

    def ask_all(
        self, command: Mapping[str, object], to: Sequence[str], timeout_s: float
    ) -> list[CommandAnswer]:
        """Send one command and return what each of its addressees says, in their order.

        Raises: LinkError when one says nothing within the time, or takes none of this operator
        """
        key = self._node.key("stop" if command.get("kind") == "stop" else "command")
        source = zenoh.SourceInfo(self._commands.id, self._sent)
        self._sent += 1
        try:
            replies = self._node.session.get(
                key, zenoh.handlers.FifoChannel(16), payload=commands.encode(command),
                attachment=self._origin, source_info=source, timeout=timeout_s,
                target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK, express=True,
            )  # fmt: skip
        except zenoh.ZError as error:
            raise LinkError(f"zenoh: a command was not sent: {error}") from None
        told: dict[str, CommandAnswer] = {}
        for reply in replies:
            answer = None if reply.ok is None else answers.read(reply.ok.payload.to_bytes())
            if answer is not None:
                told[answer.process] = answer
            if all(process in told for process in to):
                return [told[process] for process in to]
        missing = " and the ".join(process for process in to if process not in told)
        raise LinkError(
            f"the {missing} did not answer {command.get('kind')} within {timeout_s:g} s: it takes"
            " commands of operators only"
        )

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
        import asyncio  # noqa: PLC0415 - a command that asks once has no time for it

        while True:
            while (told := self.poll_status()) is not None:
                yield told
            await asyncio.sleep(_POLL_S)

    async def wait_for(self, processes: set[str], timeout_s: float) -> None:
        """Return when these processes take part and take commands.

        Raises: LinkError naming those that do not within the time
        """
        import asyncio  # noqa: PLC0415

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
